"""Ten thousand random messages on every input: nothing crashes, no finite input makes a non-finite output.

The messages go straight into the callbacks, in this process; bytes that are no message go over the wire.
"""

import random
from typing import Any

import numpy as np
import pytest
from hostile_messages import COUNT, Hostile
from ros_fixtures import Ros, overrides
from rosgraph_msgs.msg import Clock

from skydiver_utc.nodes import topics
from skydiver_utc.nodes.lockstep_controller import ControllerNode
from skydiver_utc.nodes.lockstep_plant import PlantNode
from skydiver_utc.nodes.preview import PreviewWriter
from skydiver_utc.nodes.preview_publisher import ReferenceNode
from skydiver_utc.simulation.build import build_plant, build_reference

pytest_plugins = ("ros_fixtures",)


class Sink:
    """Stands for a publisher: keeps whether all that was sent is finite."""

    def __init__(self, publisher: Any) -> None:
        self._publisher = publisher
        self.sent = 0

    def publish(self, message: Any) -> None:
        self.sent += 1
        assert np.isfinite(message.position).all()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._publisher, name)


class StateSink(Sink):
    def publish(self, message: Any) -> None:
        self.sent += 1
        p, q = message.pose.pose.position, message.pose.pose.orientation
        v, w = message.twist.twist.linear, message.twist.twist.angular
        assert np.isfinite([p.x, p.y, p.z, q.x, q.y, q.z, q.w, v.x, v.y, v.z, w.x, w.y, w.z]).all()


@pytest.mark.parametrize("mode", ["lockstep", "real_time"])
def test_commands(ros: Ros, mode: str) -> None:
    node = ros.add(PlantNode(ros.context, overrides(60.0, mode=mode, command_timeout_s=1e6)))
    node._begin()
    hostile = Hostile(1, node.grid)
    node._states, node._applieds = StateSink(node._states), Sink(node._applieds)
    pace = node._real_time
    clock_ns = 10**9
    if pace is not None:
        pace._now_ns = lambda: clock_ns
    for _ in range(COUNT):
        message = hostile.controls(node.k)
        if pace is None:
            node.on_command(message)
        elif (answer := node._read_answer(message)) is not None:
            pace.tick([answer])
        clock_ns += hostile.random.randrange(node.scenario.dt_ns)
        node.on_recorder_ready(hostile.text())
    assert node._states.sent > 1000
    assert node._applieds.sent > 1000
    assert set(node.refusals.counts) >= {"stamp", "names", "size", "finite"}
    assert node.outcome.value in ("completed", "rolled_over"), node.reason
    if pace is not None:
        told = pace.accounts.told()
        assert told["on_time"] + told["late"] + told["stale"] + told["lost"] == told["steps"]


@pytest.mark.parametrize("mode", ["lockstep", "real_time"])
@pytest.mark.parametrize("scenario", ["fast_turn_unknown_dynamics", "fast_turn_pose_only", "front_layout"])
def test_states_and_references(ros: Ros, scenario: str, mode: str) -> None:
    count = COUNT if scenario == "fast_turn_unknown_dynamics" else COUNT // 10
    node = ros.add(ControllerNode(ros.context, overrides(60.0, scenario=scenario, mode=mode)))
    hostile = Hostile(2, node.grid)
    node._commands, node._telemetry = Sink(node._commands), Sink(node._telemetry)
    near = build_plant(node.scenario).initial_state()
    signal = node.scenario.reference.signal
    needed = node._needs + 100
    for i in range(count):
        k = max(0, node.answered)
        if i % 20 == 0:
            values = build_reference(node.scenario).preview(k, needed)
            node.on_reference(PreviewWriter(node.grid, signal, needed).fill(k, values))
        node.on_state(hostile.state(k + 1, near))
        if hostile.random.random() < 0.2 or node._held is not None:
            node.on_applied(hostile.controls(k))
        if hostile.random.random() < 0.2:
            node.on_reference(hostile.preview(k, needed if hostile.random.random() < 0.2 else 5))
        node.on_claim(hostile.text())
    assert node._commands.sent > count / 20
    assert node._telemetry.sent > count / 20
    assert set(node.refusals.counts) >= {"stamp", "frame", "finite", "model", "older", "claim"}
    assert not node.finished


def test_clocks(ros: Ros) -> None:
    node = ros.add(ReferenceNode(ros.context, overrides(60.0)))
    hostile = Hostile(3, node.grid)
    for i in range(COUNT):
        message = Clock()
        hostile.stamp(message.clock, i // 4)
        node.on_clock(message)
        node.on_claim(hostile.text())
    assert set(node.refusals.counts) >= {"stamp", "claim"}
    assert not node.finished


def test_bytes_that_are_no_message(ros: Ros) -> None:
    nodes = [
        ros.add(kind(ros.context, overrides(60.0))) for kind in (PlantNode, ReferenceNode, ControllerNode)
    ]
    plant = nodes[0]
    ros.spin_until(lambda: plant.k > 3)
    partner = ros.partner("hostile")
    draw = random.Random(4)
    inputs = (topics.COMMAND, topics.STATE, topics.CLOCK, topics.REFERENCE_PREVIEW, topics.ROLL_CALL)
    inputs += (topics.CLOCK_SOURCE, topics.CLOCK_AWAITED)
    for topic in inputs:
        sender = partner.sends(topic)
        ros.spin_until(sender.get_subscription_count)
        longest = 9 if topic is topics.CLOCK else 200  # a clock of more bytes cannot be sent
        for _ in range(200):
            sender.publish(bytes([0, 1, 0, 0]) + draw.randbytes(draw.randrange(longest)))
            ros.executor.spin_once(timeout_sec=0.001)
    before = plant.k
    ros.spin_until(lambda: plant.k > before + 5)
    assert not any(node.finished for node in nodes)
