# SPDX-License-Identifier: Apache-2.0
"""Nodes of a user's own beside those of the package, each as a process; and a vehicle that knows nothing of it."""

import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from ros_fixtures import PATIENCE_S, Processes, Ros, overrides

from skydiver_utc.nodes import topics

pytest_plugins = ("ros_fixtures",)
EXAMPLES = Path(__file__).parents[3] / "examples"


class Scripts:
    """Scripts of `examples/` on the domain of the test."""

    def __init__(self, processes: Processes) -> None:
        self._environment = processes.environment
        self._started: list[subprocess.Popen[str]] = []

    def start(self, script: str, *arguments: str) -> "subprocess.Popen[str]":
        command = [sys.executable, str(EXAMPLES / script), *arguments]
        process = subprocess.Popen(command, env=self._environment, stdout=subprocess.PIPE, text=True)
        self._started.append(process)
        return process

    def end(self) -> None:
        for process in self._started:
            process.kill()
            process.communicate()


@pytest.fixture
def scripts(processes: Processes) -> Iterator[Scripts]:
    started = Scripts(processes)
    try:
        yield started
    finally:
        started.end()


@pytest.mark.parametrize("script", ["controller", "stick", "plant"])
def test_a_script_is_short(script: str) -> None:
    lines = (EXAMPLES / "own_node" / f"{script}.py").read_text().splitlines()
    assert len([line for line in lines if line]) <= 40


def test_the_vehicle_is_short_and_knows_nothing_of_the_package() -> None:
    text = (EXAMPLES / "real_vehicle" / "vehicle.py").read_text()
    assert len(text.splitlines()) <= 60
    assert "skydiver_utc" not in text


def test_a_controller_of_ones_own(processes: Processes, scripts: Scripts) -> None:
    scripts.start("own_node/controller.py")
    processes.start("reference", overrides(0.3))
    plant = processes.start("plant", overrides(0.3, progress=True))
    assert plant.wait() == 0
    assert plant.reports()[-1]["outcome"] == "completed"


def test_a_plant_of_ones_own(processes: Processes, scripts: Scripts) -> None:
    processes.start("reference", overrides(0.5))
    processes.start("controller", overrides(0.5))
    plant = scripts.start("own_node/plant.py", "100")
    said, _ = plant.communicate(timeout=PATIENCE_S)
    assert plant.returncode == 0
    assert said.startswith("100 steps")
    assert float(said.split()[-2]) != 0.0


def test_a_stick_of_ones_own(ros: Ros, processes: Processes, scripts: Scripts) -> None:
    scenario = {"scenario": str(EXAMPLES / "own_node" / "stick.yaml"), "duration_s": 0.5}
    setpoints = ros.partner().receive(topics.SETPOINT)
    scripts.start("own_node/stick.py", "1.5")
    for kind in ("reference", "controller"):
        processes.start(kind, scenario)
    plant = processes.start("plant", scenario)
    assert plant.wait() == 0
    ros.spin_until(lambda: len(setpoints) > 100)
    assert list(setpoints[-1].name) == ["yaw_rate"]
    assert setpoints[-1].position[0] == 1.5


def test_a_real_vehicle_follows_the_reference(ros: Ros, processes: Processes, scripts: Scripts) -> None:
    partner = ros.partner()
    rates: list[float] = []
    partner.create_subscription(
        topics.STATE.type, "/odom", lambda message: rates.append(message.twist.twist.angular.z), 10
    )
    vehicle = scripts.start("real_vehicle/vehicle.py")
    arguments = ("--params-file", str(EXAMPLES / "real_vehicle" / "nodes.yaml"), "-r", "state:=/odom")
    controller = processes.start("controller", {}, ros_arguments=(*arguments, "-r", "command:=/cmd_vel"))
    processes.start("reference", {}, ros_arguments=arguments)
    ros.spin_until(lambda: max(rates, default=0.0) > 1.0)
    assert partner.count_publishers("/clock") == 0
    controller.signal(signal.SIGTERM)
    assert controller.wait() == 0
    assert vehicle.poll() is None
