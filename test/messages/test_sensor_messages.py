# SPDX-License-Identifier: Apache-2.0
"""Measurements in ROS messages and back."""

from types import SimpleNamespace

import numpy as np
from plain_messages import joint_state

from skydiver_utc.messages import fill_fields, read_fields

FIELDS = tuple(f"linear_acceleration.{axis}" for axis in "xyz")


def imu() -> SimpleNamespace:
    parts = ("angular_velocity", "linear_acceleration")
    covariances = {f"{part}_covariance": np.zeros(9) for part in ("orientation", *parts)}
    return SimpleNamespace(**{part: SimpleNamespace(x=0.0, y=0.0, z=0.0) for part in parts}, **covariances)


def test_a_measurement_comes_back_with_its_bits_and_an_imu_says_what_it_does_not_measure() -> None:
    values = np.array([0.1, -2.0, 1.0 / 3.0])
    message = fill_fields(imu(), values, FIELDS)
    np.testing.assert_array_equal(read_fields(message, FIELDS, "xyz"), values)
    assert message.orientation_covariance[0] == message.angular_velocity_covariance[0] == -1.0
    assert message.linear_acceleration_covariance[0] == 0.0
    by_name = fill_fields(joint_state(("angle",), ()), values[:1], ())
    np.testing.assert_array_equal(read_fields(by_name, (), ("angle",)), values[:1])
