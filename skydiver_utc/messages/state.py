# SPDX-License-Identifier: Apache-2.0
"""A plant's state in a nav_msgs/Odometry, or by name in a sensor_msgs/JointState."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.messages.named import fill_named, read_named
from skydiver_utc.messages.odometry import fill_odometry, read_odometry

Vector = NDArray[np.float64]


def fill_state(message: Any, state: Vector) -> Any:
    """Write a state (n,); a JointState has the names already. Returns the message."""
    return fill_odometry(message, state) if hasattr(message, "pose") else fill_named(message, state)


def read_state(message: Any, names: Sequence[str], frames: tuple[str, str] | None = None) -> Vector:
    """The state (n,), of a JointState in the order of the names; an Odometry must be in these frames, if given."""
    return read_odometry(message, frames) if hasattr(message, "pose") else read_named(message, names)
