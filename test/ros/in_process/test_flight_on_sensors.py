# SPDX-License-Identifier: Apache-2.0
"""A skydiver flown over ROS on sensors, some of whose measurements come late or not at all."""

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import invoke
from recorded import Bag, assert_complete, assert_equals_simulation
from ros_fixtures import Ros, overrides

from skydiver_utc.estimators.consistency import VERDICTS
from skydiver_utc.nodes import topics

pytest_plugins = ("ros_fixtures",)


@pytest.mark.long
def test_a_flight_on_sensors_equals_the_simulation_and_its_check(ros: Ros, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    given = overrides(
        0.5,
        scenario="fast_turn_gyro_accelerometer",
        estimator__sensors__gyroscope__delay_s=0.02,
        estimator__sensors__gyroscope__loss=0.2,
    )
    recorder = ros.node("recorder", given | {"out": str(folder)})
    nodes = ros.start(given | {"wait_for_recorder": True}, "reference", "estimator", "controller", "plant")
    ros.spin_until(lambda: recorder.finished and not recorder.not_in_bag())
    assert [node.close() for node in (*nodes, recorder)] == [0] * 5
    bag = Bag(folder)
    assert_complete(bag)
    assert_equals_simulation(bag)
    rates = bag.of(topics.sensor_topic("gyroscope", "Imu"))
    assert 0 < len(rates) < len(bag.of(topics.sensor_topic("accelerometer", "Imu"))) == 25
    assert rates[0].linear_acceleration_covariance[0] == -1.0
    assert np.isfinite([rates[0].angular_velocity.x, rates[0].angular_velocity.z]).all()
    estimates, (*_, last) = bag.of(topics.ESTIMATE), bag.of(topics.ESTIMATOR_TELEMETRY)
    judged = dict(zip(last.name, last.position, strict=True))
    assert judged["nis_low_accelerometer"] < 3.0 < judged["nis_high_accelerometer"]
    assert VERDICTS[int(judged["verdict_accelerometer"])] == "consistent"
    np.testing.assert_allclose(
        np.sqrt(estimates[-1].twist.covariance[35]), judged["deviation_wz"], rtol=1e-12
    )
    pose = np.reshape(estimates[-1].pose.covariance, (6, 6))
    turn = sum(judged[f"deviation_attitude_{axis}"] ** 2 for axis in "xyz")
    np.testing.assert_allclose(np.trace(pose[3:, 3:]), turn, rtol=1e-12)
    checked = invoke("replay", folder, "--check", "--json")
    assert checked.exit_code == 0, checked.output
    assert json.loads(checked.output)["equal"]
