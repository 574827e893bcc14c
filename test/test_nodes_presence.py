"""A silence told from a death: by the lease of a process, in log, diagnostics and outcome."""

import json
import signal
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import QoSDurabilityPolicy, QoSProfile
from ros_fixtures import Partner, Processes, Ros, overrides

from skydiver_utc.nodes import topics
from skydiver_utc.nodes.bag_recorder import RecorderNode
from skydiver_utc.nodes.lockstep_plant import PlantNode
from skydiver_utc.nodes.presence import Presence, State
from skydiver_utc.nodes.preview_publisher import ReferenceNode
from skydiver_utc.nodes.topics import RECORDED

pytest_plugins = ("ros_fixtures",)


def after(*counts: tuple[int, int]) -> tuple[State, list[str]]:
    """The state and what was told after the middleware counted so many leases, alive and not."""
    told: list[str] = []
    presence = Presence("controller", told.append)
    for (alive_before, dead_before), (alive, dead) in pairwise(((0, 0), *counts)):
        presence.on_change(
            SimpleNamespace(
                alive_count=alive,
                not_alive_count=dead,
                alive_count_change=alive - alive_before,
                not_alive_count_change=dead - dead_before,
            )
        )
    return presence.state, told


# The counts are those seen of processes that were killed (-9), stopped and continued, and interrupted.
@pytest.mark.parametrize(
    ("counts", "state", "told"),
    [
        ([], State.UNKNOWN, []),
        ([(1, 0)], State.ALIVE, []),
        ([(1, 0), (0, 1)], State.DIED, ["has died"]),
        ([(1, 0), (0, 1), (0, 0)], State.DIED, ["has died", "has died"]),
        ([(1, 0), (0, 1), (1, 1)], State.ALIVE, ["has died", "is there again"]),
        ([(1, 0), (0, 1), (1, 1), (1, 0)], State.ALIVE, ["has died", "is there again"]),
        ([(1, 0), (0, 1), (1, 1), (0, 1)], State.ENDED, ["has died", "is there again"]),
        ([(2, 0), (1, 1)], State.ALIVE, []),
        ([(1, 0), (0, 0)], State.ENDED, []),
    ],
)
def test_the_counts_of_leases_tell_what_became_of_a_process(
    counts: list[tuple[int, int]], state: State, told: list[str]
) -> None:
    found, sentences = after(*counts)
    assert found is state
    assert len(sentences) == len(told)
    assert all(part in sentence for part, sentence in zip(told, sentences, strict=True))


class Watched:
    """Plant, controller and reference as processes, and what a partner hears of them."""

    def __init__(self, ros: Ros, processes: Processes, **of_plant: object) -> None:
        self.ros = ros
        watcher: Partner = ros.partner("watcher")
        self.states, self.outcomes = watcher.hear(topics.STATE), watcher.hear(topics.OUTCOME)
        self.diagnostics: list[DiagnosticArray] = watcher.hear(topics.DIAGNOSTICS)
        given = overrides(600.0)
        self.plant = processes.start("plant", given | of_plant)
        self.controller = processes.start("controller", given)
        self.reference = processes.start("reference", given)
        ros.spin_until(lambda: len(self.states) > 50)

    def said_by_plant(self) -> dict[str, str]:
        """The values of the plant's newest diagnostics, with its sentence."""
        statuses = [m.status[0] for m in self.diagnostics if m.status[0].name == "skydiver/plant"]
        if not statuses:
            return {}
        return {"sentence": statuses[-1].message, **{v.key: v.value for v in statuses[-1].values}}

    def outcome(self) -> dict[str, Any]:
        self.ros.spin_until(lambda: self.outcomes)
        return dict(json.loads(self.outcomes[0].data))


def test_a_controller_that_was_killed_has_died_in_log_diagnostics_and_outcome(
    ros: Ros, processes: Processes
) -> None:
    flight = Watched(ros, processes, command_timeout_s=0.5, command_retries=5)
    ros.spin_until(lambda: flight.said_by_plant().get("controller_process") == "alive")
    flight.controller.kill()
    flight.plant.wait_for_output("the controller's process has died or stands still")
    ros.spin_until(lambda: "process has died" in flight.said_by_plant()["sentence"])
    assert flight.said_by_plant()["controller_process"] == "died"
    told = flight.outcome()
    assert told["outcome"] == "no_command"
    assert told["reason"].endswith("; the controller's process has died or stands still")


def test_a_controller_without_a_reference_is_alive_but_silent(ros: Ros, processes: Processes) -> None:
    flight = Watched(ros, processes, command_timeout_s=0.5, command_retries=5)
    flight.reference.kill()
    flight.controller.wait_for_output("the reference's process has died or stands still")
    told = flight.outcome()
    assert told["outcome"] == "no_command"
    assert told["reason"].endswith("; the controller's process is alive but silent")


def test_a_process_that_stood_still_is_there_again(ros: Ros, processes: Processes) -> None:
    flight = Watched(ros, processes, command_timeout_s=0.5, command_retries=1000)
    flight.controller.signal(signal.SIGSTOP)
    flight.plant.wait_for_output("the controller's process has died or stands still")
    flight.controller.signal(signal.SIGCONT)
    flight.plant.wait_for_output("a process of the controller is there again")
    count = len(flight.states)
    ros.spin_until(lambda: len(flight.states) > count + 50)


@pytest.mark.parametrize("topic", RECORDED, ids=lambda topic: topic.name)
def test_tools_with_the_default_quality_hear_every_topic(ros: Ros, topic: topics.Topic) -> None:
    """No lease, no deadline: a listener with rclpy's default matches every topic of the flight."""
    node = ros.partner("tool")
    listener = node.create_subscription(topic.type, topic.name, lambda _: None, QoSProfile(depth=10))
    sender = node.create_publisher(topic.type, topic.name, topic.qos)
    ros.spin_until(lambda: sender.get_subscription_count() == 1 == listener.get_publisher_count())


@pytest.mark.parametrize(
    ("kind", "topic"),
    [
        *((RecorderNode, topic) for topic in RECORDED),
        (PlantNode, topics.COMMAND),
        (ReferenceNode, topics.CLOCK),
    ],
    ids=lambda value: value.name if isinstance(value, topics.Topic) else value.__name__,
)
def test_tools_with_the_default_quality_are_heard_except_on_latched_topics(
    ros: Ros, tmp_path: Path, kind: Any, topic: topics.Topic
) -> None:
    """Against the subscriptions of the nodes themselves; on a latched topic a tool must latch, too."""
    recorder = {"bag_folder": str(tmp_path / "bag")} if kind is RecorderNode else {}
    ros.add(kind(ros.context, overrides(**recorder)))
    tool = ros.partner("tool")
    latching = QoSProfile(depth=10, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
    heard = tool.create_publisher(topic.type, topic.name, latching)
    ros.spin_until(lambda: heard.get_subscription_count() >= 1)
    usual = tool.create_publisher(topic.type, topic.name, QoSProfile(depth=10))
    if topic.latched:
        ros.spin_for(0.5)
        assert usual.get_subscription_count() == 0
    else:
        ros.spin_until(lambda: usual.get_subscription_count() >= 1)
