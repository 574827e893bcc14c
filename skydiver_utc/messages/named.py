# SPDX-License-Identifier: Apache-2.0
"""Values by name in the `position` of a sensor_msgs/JointState: states, controls, setpoints, telemetry."""

import array
from collections.abc import Sequence
from typing import Any

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.messages.errors import MessageError, refuse_non_finite


def fill_named(message: Any, values: Array) -> Any:
    """Write values (n,) in the order of the names that the message has already; returns the message.

    rclpy sends other than Python or C doubles as garbage without an error, hence the array.
    """
    if len(values) != len(message.name):
        raise ValueError(f"{len(values)} values for {len(message.name)} names")
    message.position = array.array("d", values.tobytes())
    return message


def read_named(message: Any, names: Sequence[str], finite: bool = True) -> Array:
    """Values (n,) in the order of `names`, which the message names once each, in any order; finite unless allowed."""
    given, values = list(message.name), np.array(message.position, dtype=np.float64)
    if len(values) != len(given):
        raise MessageError(
            "size", f"it has {len(values)} values in position for {len(given)} names: give one each"
        )
    if given != list(names):
        if sorted(given) != sorted(names):
            raise MessageError("names", f"it names {given}: it must name {list(names)}, in any order")
        values = values[[given.index(name) for name in names]]
    if finite:
        refuse_non_finite(values, names)
    return values
