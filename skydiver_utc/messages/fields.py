# SPDX-License-Identifier: Apache-2.0
"""Measurements of a sensor, or values of a twist, in fields of a message, each named as in `linear_acceleration.x`."""

from collections.abc import Sequence
from operator import attrgetter
from typing import Any

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.messages.errors import refuse_non_finite
from skydiver_utc.messages.named import fill_named, read_named

TWIST_COMPONENTS = tuple(f"{part}.{axis}" for part in ("linear", "angular") for axis in "xyz")
# By ROS's convention the first number of a covariance is -1 where an Imu does not measure that.
_OF_IMU = ("orientation", "angular_velocity", "linear_acceleration")


def fill_fields(message: Any, values: Array, fields: Sequence[str]) -> Any:
    """Write values (l,) into these fields; without fields into a JointState that has the names. Returns the message."""
    if not fields:
        return fill_named(message, values)
    for part in _OF_IMU if hasattr(message, "linear_acceleration") else ():
        if not fields[0].startswith(part):
            getattr(message, f"{part}_covariance")[0] = -1.0
    for field, value in zip(fields, values.tolist(), strict=True):
        place, _, last = field.rpartition(".")
        setattr(attrgetter(place)(message) if place else message, last, value)
    return message


def read_fields(message: Any, fields: Sequence[str], names: Sequence[str] = ()) -> Array:
    """The values (l,) of these fields, or by name of a JointState."""
    if not fields:
        return read_named(message, names)
    values = np.array([attrgetter(field)(message) for field in fields], dtype=np.float64)
    refuse_non_finite(values, fields)
    return values
