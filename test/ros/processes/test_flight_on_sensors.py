# SPDX-License-Identifier: Apache-2.0
"""A skydiver flown over ROS on sensors, some of whose measurements come late or not at all."""

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import call, invoke
from recorded import Bag, assert_complete, assert_equals_simulation

from skydiver_utc.nodes.topics import sensor_topic

pytest_plugins = ("ros_domains",)
pytestmark = [pytest.mark.processes, pytest.mark.long]


def test_a_flight_on_sensors_equals_the_simulation_and_its_check(domain: int, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    gyroscope = {"duration_s": 0.5}
    gyroscope |= {
        f"estimator.sensors.gyroscope.{name}": v for name, v in {"delay_s": 0.02, "loss": 0.2}.items()
    }
    settings = [word for name, value in gyroscope.items() for word in ("--set", f"{name}={value}")]
    code, _, error = call(
        "run", "fast_turn_gyro_accelerometer", "--quiet", "--out", folder, *settings, ROS_DOMAIN_ID=domain
    )
    assert code == 0, error
    bag = Bag(folder)
    assert_complete(bag)
    assert_equals_simulation(bag)
    rates = bag.of(sensor_topic("gyroscope", "Imu"))
    assert 0 < len(rates) < len(bag.of(sensor_topic("accelerometer", "Imu"))) == 25
    assert rates[0].linear_acceleration_covariance[0] == -1.0
    assert np.isfinite([rates[0].angular_velocity.x, rates[0].angular_velocity.z]).all()
    checked = invoke("replay", folder, "--check", "--json")
    assert checked.exit_code == 0, checked.output
    assert json.loads(checked.output)["equal"]
