"""Ten thousand hostile messages over the wire into a flight of four processes, from one more that means harm."""

import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hostile_messages import COUNT, Hostile
from ros_fixtures import NodeProcess, Processes, Ros, overrides
from rosgraph_msgs.msg import Clock
from test_nodes_flight import Bag

from skydiver_utc.analysis.recorded_flight import RecordedFlight
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.messages import read_named_values, read_state
from skydiver_utc.nodes.stamps import StepGrid
from skydiver_utc.parameters import load_scenario
from skydiver_utc.plant.skydiver import CONTROL_NAMES
from skydiver_utc.simulation.build import build_plant
from skydiver_utc.simulation.outcome import Outcome, dorsal_axis_height

pytest_plugins = ("ros_fixtures",)

SCENARIO = "fast_turn_unknown_dynamics"
DURATION_S = 600.0
MARK = 7.0  # in fields that our nodes neither send nor read: a message that is not the plant's
REACH = 51  # beyond the steps that an attack's stamps name before and after the one that is due


class Attacker:
    """Sends on every input of the four nodes, mostly with the stamp of the step that is due."""

    def __init__(self, ros: Ros, seed: int) -> None:
        scenario = load_scenario(SCENARIO, {"duration_s": DURATION_S})
        self.ros, self.grid = ros, StepGrid(scenario)
        self.hostile = Hostile(seed, self.grid)
        self.near = build_plant(scenario).initial_state()
        self.partner = ros.partner("attacker")
        self.applied: list[Any] = []  # the plant's
        self.partner.hear(topics.APPLIED_COMMAND, lambda m: m.effort or self.applied.append(m))
        makes = {
            topics.COMMAND: self.hostile.controls,
            topics.STATE: self.state,
            topics.REFERENCE_PREVIEW: lambda k: self.hostile.preview(k, 20),
            topics.CLOCK: self.clock,
            topics.ROLL_CALL: lambda _: self.hostile.text(),
            topics.CLOCK_SOURCE: lambda _: self.hostile.text(),
            topics.CLOCK_AWAITED: lambda _: self.hostile.text(),
            topics.RECORDER_READY: lambda _: self.hostile.text(),
            topics.TELEMETRY: self.hostile.controls,
            topics.APPLIED_COMMAND: self.marked,
            topics.JOINT_STATES: self.hostile.controls,
            topics.SETPOINT: lambda k: self.stamped(topics.SETPOINT, k),
            topics.DIAGNOSTICS: lambda k: self.stamped(topics.DIAGNOSTICS, k),
            topics.OUTCOME: lambda _: self.hostile.text(),
            topics.SCENARIO: lambda _: self.hostile.text(),
            topics.CHANGES: lambda _: self.hostile.text(),
        }
        self.inputs = [(self.partner.sends(topic), make) for topic, make in makes.items()]

    def step(self) -> int:
        return self.grid.step_of(self.applied[-1].header.stamp) + 1 if self.applied else 0

    def state(self, k: int) -> Any:
        message = self.hostile.state(k, self.near)
        message.pose.covariance[35] = MARK
        return message

    def marked(self, k: int) -> Any:
        message = self.hostile.controls(k)
        message.effort = [MARK]
        return message

    def stamped(self, topic: topics.Topic, k: int) -> Any:
        message = topic.type()
        self.hostile.stamp(message.header.stamp, k)
        return message

    def clock(self, k: int) -> Any:
        message = Clock()
        self.hostile.stamp(message.clock, k)
        return message

    def attack(self) -> None:
        for _ in range(COUNT):
            sender, make = self.hostile.random.choice(self.inputs)
            sender.publish(make(self.step()))
            self.ros.executor.spin_once(timeout_sec=0.0)


def refused(node: NodeProcess) -> str:
    """What the node says at its end about the messages that it refused."""
    (line,) = [line for line in node.output.splitlines() if "messages refused or ignored" in line]
    return line


@pytest.mark.parametrize("mode", ["lockstep", "real_time"])
def test_a_flight_under_fire_goes_on_and_stays_finite(
    ros: Ros, processes: Processes, tmp_path: Path, mode: str
) -> None:
    attacker = Attacker(ros, seed=5)
    given = overrides(DURATION_S, wait_for_recorder=True)
    recorder = processes.start("recorder", overrides(DURATION_S, bag_folder=tmp_path / "bag"))
    patient = {"command_timeout_s": 0.5, "command_retries": 200, "mode": mode}
    plant = processes.start("plant", given | patient | {"progress": True})
    controller = processes.start("controller", given | {"mode": mode})
    reference = processes.start("reference", given)
    ros.spin_until(lambda: attacker.step() > 2 * REACH)
    before = attacker.step() - REACH
    attacker.attack()
    after = attacker.step()
    ros.spin_until(lambda: attacker.step() > after + 2 * REACH)
    for node in (plant, controller, reference):
        node.signal(signal.SIGINT)
        assert node.wait() == 0, node.output
    assert recorder.wait() == 0, recorder.output

    for kind in ("stamp", "names", "size", "finite"):
        assert kind in refused(plant)
    for kind in ("stamp", "names", "finite", "model", "claim"):
        assert kind in refused(controller)
    bag = Bag(tmp_path / "bag")
    own = [message for message in bag.of(topics.STATE) if message.pose.covariance[35] != MARK]
    flown = [read_state(message) for message in own]
    assert len(flown) > after
    for message in bag.of(topics.APPLIED_COMMAND):
        assert message.effort or np.isfinite(read_named_values(message, CONTROL_NAMES)).all()
    recording = RecordedFlight(tmp_path / "bag")
    flight = recording.flight()
    assert flight.outcome is Outcome.ABORTED or "roll" in flight.reason
    assert dorsal_axis_height(np.array(flown)).min() > 0.0 or "roll" in flight.reason
    assert recording.ignored.keys() >= {"state", "command", "applied_command", "outcome", "changes"}
    by_step = {attacker.grid.step_of(m.header.stamp): state for m, state in zip(own, flown, strict=True)}
    for k in [*range(before), *range(after + REACH, len(flight.states))]:
        assert np.array_equal(flight.states[k], by_step[k]), k
    for node in (plant, controller, reference, recorder):
        assert "Traceback" not in node.output
