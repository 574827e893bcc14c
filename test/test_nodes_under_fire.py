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

from skydiver_utc.nodes import topics
from skydiver_utc.nodes.messages import read_named_values, read_state
from skydiver_utc.nodes.stamps import StepGrid
from skydiver_utc.parameters import load_scenario
from skydiver_utc.plant.skydiver import CONTROL_NAMES
from skydiver_utc.simulation.build import build_plant
from skydiver_utc.simulation.outcome import dorsal_axis_height

pytest_plugins = ("ros_fixtures",)

SCENARIO = "fast_turn_unknown_dynamics"
DURATION_S = 600.0
MARK = 7.0  # in a covariance that our nodes neither send nor read: a state that is not the plant's


class Attacker:
    """Sends on every input of the four nodes, mostly with the stamp of the step that is due."""

    def __init__(self, ros: Ros, seed: int) -> None:
        scenario = load_scenario(SCENARIO, {"duration_s": DURATION_S})
        self.ros, self.grid = ros, StepGrid(scenario)
        self.hostile = Hostile(seed, self.grid)
        self.near = build_plant(scenario).initial_state()
        self.partner = ros.partner("attacker")
        self.applied = self.partner.hear(topics.APPLIED_COMMAND)
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
        }
        self.inputs = [(self.partner.sends(topic), make) for topic, make in makes.items()]

    def step(self) -> int:
        return self.grid.step_of(self.applied[-1].header.stamp) + 1 if self.applied else 0

    def state(self, k: int) -> Any:
        message = self.hostile.state(k, self.near)
        message.pose.covariance[35] = MARK
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
    ros.spin_until(lambda: attacker.step() > 50)
    attacker.attack()
    after = attacker.step()
    ros.spin_until(lambda: attacker.step() > after + 100)
    for node in (plant, controller, reference):
        node.signal(signal.SIGINT)
        assert node.wait() == 0, node.output
    assert recorder.wait() == 0, recorder.output

    for kind in ("stamp", "names", "size", "finite"):
        assert kind in refused(plant)
    for kind in ("stamp", "names", "finite", "model", "claim"):
        assert kind in refused(controller)
    bag = Bag(tmp_path / "bag")
    flown = [read_state(message) for message in bag.of(topics.STATE) if message.pose.covariance[35] != MARK]
    assert len(flown) > after
    assert dorsal_axis_height(np.array(flown)).min() > 0.0 or "roll" in bag.outcome()["reason"]
    for message in bag.of(topics.APPLIED_COMMAND):
        assert np.isfinite(read_named_values(message, CONTROL_NAMES)).all()
    for node in (plant, controller, reference, recorder):
        assert "Traceback" not in node.output
