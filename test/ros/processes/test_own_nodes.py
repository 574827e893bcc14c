# SPDX-License-Identifier: Apache-2.0
"""Nodes of a user's own beside those of the package, each as a process; and a vehicle that knows nothing of it."""

import signal
from pathlib import Path

import pytest
from ros_fixtures import Processes, Ros, overrides

from skydiver_utc.messages import read_outcome
from skydiver_utc.nodes import topics

pytest_plugins = ("ros_fixtures",)
pytestmark = pytest.mark.processes
EXAMPLES = Path(__file__).parents[3] / "examples"


def test_scripts_are_short_and_the_vehicle_knows_nothing_of_the_package() -> None:
    for script in ("controller", "stick", "plant"):
        lines = (EXAMPLES / "own_node" / f"{script}.py").read_text().splitlines()
        assert len([line for line in lines if line]) <= 40, script
    text = (EXAMPLES / "real_vehicle" / "vehicle.py").read_text()
    assert len(text.splitlines()) <= 60
    assert "skydiver_utc" not in text


def test_a_controller_of_ones_own(processes: Processes) -> None:
    processes.python("script", str(EXAMPLES / "own_node/controller.py"))
    processes.start("reference", overrides(0.3))
    plant = processes.start("plant", overrides(0.3, progress=True))
    assert plant.wait() == 0
    assert plant.reports()[-1]["outcome"] == "completed"


def test_a_plant_of_ones_own(processes: Processes) -> None:
    processes.start("reference", overrides(0.5))
    processes.start("controller", overrides(0.5))
    plant = processes.python("script", str(EXAMPLES / "own_node/plant.py"), "100")
    assert plant.wait() == 0
    last = plant.output.splitlines()[-1]
    assert last.startswith("100 steps")
    assert float(last.split()[-2]) != 0.0


def test_a_stick_of_ones_own(ros: Ros, processes: Processes) -> None:
    scenario = {"scenario": str(EXAMPLES / "own_node" / "stick.yaml")}
    partner = ros.partner()
    setpoints, outcomes = partner.receive(topics.SETPOINT), partner.receive(topics.OUTCOME)
    processes.python("script", str(EXAMPLES / "own_node/stick.py"), "1.5")
    for kind in ("reference", "controller"):
        processes.start(kind, scenario)
    plant = processes.start("plant", scenario)
    # In lockstep the flight may begin before the reference node has found the stick.
    ros.spin_until(lambda: bool(setpoints) and setpoints[-1].position[0] == 1.5)
    assert list(setpoints[-1].name) == ["yaw_rate"]
    plant.signal(signal.SIGTERM)
    assert plant.wait() == 0
    ros.spin_until(lambda: outcomes)
    assert read_outcome(outcomes[-1].data)["outcome"] == "aborted"


def test_a_real_vehicle_follows_the_reference(ros: Ros, processes: Processes) -> None:
    partner = ros.partner()
    rates: list[float] = []
    partner.create_subscription(
        topics.STATE.type, "/odom", lambda message: rates.append(message.twist.twist.angular.z), 10
    )
    vehicle = processes.python("script", str(EXAMPLES / "real_vehicle/vehicle.py"))
    arguments = ("--params-file", str(EXAMPLES / "real_vehicle" / "nodes.yaml"), "-r", "state:=/odom")
    controller = processes.start("controller", {}, *arguments, "-r", "command:=/cmd_vel")
    processes.start("reference", {}, *arguments)
    ros.spin_until(lambda: max(rates, default=0.0) > 1.0)
    assert partner.count_publishers("/clock") == 0
    controller.signal(signal.SIGTERM)
    assert controller.wait() == 0
    assert not vehicle.ended
