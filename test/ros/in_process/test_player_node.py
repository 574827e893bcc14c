# SPDX-License-Identifier: Apache-2.0
"""The player node: a recording published again, byte for byte and in order, at any rate."""

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from own_slots import cart_file
from rclpy.qos import QoSProfile
from recorded import fly
from ros_domains import reserved_domain
from ros_fixtures import JOINT_STATE, Partner, Ros
from rosgraph_msgs.msg import Clock

from bags import Row, text_message, write_bag
from skydiver_utc.errors import RecordingError
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.lifecycle import RefusedError
from skydiver_utc.nodes.player_node import PlayerNode
from skydiver_utc.nodes.topics import RECORDED, Topic
from skydiver_utc.parameters import ParameterError
from skydiver_utc.recording.reader import read_bag
from skydiver_utc.recording.schemas import message_schema
from skydiver_utc.recording.writer import BagWriter

pytest_plugins = ("ros_fixtures",)

DEPTH = 5000
OF_NODES = (topics.LOGS, topics.PARAMETER_EVENTS)
OF_CART = tuple(JOINT_STATE if each is topics.STATE else each for each in RECORDED if each not in OF_NODES)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recorded run of the cart; its nodes are gone."""
    folder = tmp_path_factory.mktemp("recorded")
    with reserved_domain() as domain, closing(Ros(domain)) as ros:
        return fly(ros, folder / "run", {"scenario": cart_file(folder)}).folder


class Audience:
    """Receives topics as bytes, in order within each topic."""

    def __init__(self, ros: Ros, subscribed: tuple[Topic, ...] = OF_CART) -> None:
        self.partner: Partner = ros.partner("audience")
        self.received: dict[str, list[bytes]] = {}
        for topic in subscribed:
            name = topic.name if topic.name.startswith("/") else f"/skydiver/{topic.name}"
            messages = self.received.setdefault(name, [])
            qos = QoSProfile(depth=DEPTH, reliability=topic.qos.reliability, durability=topic.qos.durability)
            self.partner.create_subscription(topic.type, name, messages.append, qos, raw=True)

    @property
    def count(self) -> int:
        return sum(map(len, self.received.values()))


def player(ros: Ros, run: Path, **parameters: object) -> PlayerNode:
    node: PlayerNode = ros.add(PlayerNode(ros.context, {"run": str(run), **parameters}))
    return node


@pytest.mark.parametrize("rate", [0.7, 1000.0])
def test_every_message_comes_again_in_the_order_of_its_time_byte_for_byte(
    ros: Ros, run: Path, rate: float
) -> None:
    audience = Audience(ros)
    node = player(ros, run, rate=rate)
    recorded = {
        name: [topic.cdr[i] for i in np.argsort(topic.log_times_ns, kind="stable")]
        for name, topic in read_bag(run).items()
        if len(topic) and name not in {each.name for each in OF_NODES}
    }
    ros.spin_until(lambda: node.finished)
    ros.spin_until(lambda: audience.count >= sum(map(len, recorded.values())))
    assert {name: messages for name, messages in audience.received.items() if messages} == recorded
    assert node.close() == 0


def test_the_order_within_a_step_is_that_of_the_table(ros: Ros, run: Path) -> None:
    node = player(ros, run)
    stamps = [item.log_time_ns for item in node.items]
    assert stamps == sorted(stamps)
    of_step = [item.topic for item in node.items if item.log_time_ns == stamps[len(stamps) // 2]]
    places = [of_step.index(f"/skydiver/{name}") for name in ("state", "command", "applied_command")]
    assert [of_step.index("/clock"), *places] == sorted([of_step.index("/clock"), *places])


def test_latched_messages_are_latched_again(ros: Ros, run: Path) -> None:
    node = player(ros, run, rate=1000.0, start_s=0.3)
    ros.spin_until(lambda: node.finished)
    late = Audience(ros, (topics.SCENARIO, topics.OUTCOME, topics.REFERENCE_PREVIEW, JOINT_STATE))
    recorded = read_bag(run)
    latched = ("/skydiver/scenario", "/skydiver/outcome", "/skydiver/reference")
    ros.spin_until(lambda: late.count >= sum(len(recorded[name]) for name in latched))
    for name in latched:
        assert late.received[name] == recorded[name].cdr
    assert late.received["/skydiver/state"] == []


def test_start_and_topics_choose_what_is_played(ros: Ros, run: Path) -> None:
    audience = Audience(ros)
    node = player(ros, run, rate=1000.0, start_s=0.2, topics=["state", "/skydiver/command"])
    ros.spin_until(lambda: node.finished)
    recorded = read_bag(run)
    begin_ns = min(topic.log_times_ns.min() for topic in recorded.values() if len(topic)) + 200_000_000
    expected = {
        name: [
            cdr
            for cdr, log_time in zip(recorded[name].cdr, recorded[name].log_times_ns, strict=True)
            if log_time >= begin_ns
        ]
        for name in ("/clock", "/skydiver/state", "/skydiver/command")
    }
    ros.spin_until(lambda: audience.count >= sum(map(len, expected.values())))
    assert {name: messages for name, messages in audience.received.items() if messages} == expected


def text_bag(folder: Path) -> Path:
    rows = [Row("/text", 10**18 + k * 10**7, 1, text_message(str(k))) for k in range(3)]
    return write_bag(folder, rows, schema=message_schema("std_msgs/msg/String"))


def test_a_recording_without_a_clock_gets_one(ros: Ros, tmp_path: Path) -> None:
    audience = Audience(ros, ())
    clocks: list[Clock] = []
    audience.partner.create_subscription(Clock, "/clock", clocks.append, 10)
    node = player(ros, text_bag(tmp_path / "bag"))
    ros.spin_until(lambda: node.finished and len(clocks) == 3)
    assert [clock.clock.nanosec for clock in clocks] == [0, 10_000_000, 20_000_000]


@pytest.mark.parametrize(
    ("parameters", "word"),
    [({"topics": ["/other"]}, "/other"), ({"rate": float("nan")}, "rate"), ({"rat": 5.0}, "rat")],
)
def test_wrong_parameters_are_named(
    ros: Ros, tmp_path: Path, parameters: dict[str, object], word: str
) -> None:
    with pytest.raises((ParameterError, RecordingError), match=word):
        player(ros, text_bag(tmp_path / "bag"), **parameters)


@pytest.mark.parametrize(
    "schema",
    [("own_msgs/msg/Text", "string data\n", ""), ("std_msgs/msg/String", "string data\n", "RIHS01_0")],
    ids=["not installed", "another definition"],
)
def test_a_type_that_is_not_installed_is_named(
    ros: Ros, tmp_path: Path, schema: tuple[str, str, str]
) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        bag.write(bag.add_topic("/text", *schema, ""), text_message("x"), 1, 1)
    with pytest.raises(ParameterError, match=schema[0]):
        player(ros, tmp_path / "bag")


def test_a_replay_beside_another_clock_is_refused(ros: Ros, tmp_path: Path) -> None:
    ros.partner("other").publisher(topics.CLOCK)
    with pytest.raises(RefusedError, match="/clock"):
        player(ros, text_bag(tmp_path / "bag"))
