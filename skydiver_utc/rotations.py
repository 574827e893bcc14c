# SPDX-License-Identifier: Apache-2.0
"""Attitudes as quaternions x y z w, body to world."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.jit import kernel

Array = NDArray[np.float64]


def up_components(x: Any, y: Any, z: Any, w: Any) -> tuple[Any, Any, Any]:
    """The world's up direction in body axes, of a quaternion's components: numbers, arrays or symbols."""
    return 2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)


up_of_quaternion = kernel(up_components)


def world_up(states: Array) -> Array:
    """The world's up direction (..., 3) in body axes for states (..., 13)."""
    return np.stack(up_components(*np.moveaxis(states[..., 3:7], -1, 0)), axis=-1)


def dorsal_axis_height(states: Array) -> Array:
    """Height (...) of the dorsal axis for states (..., 13): 1 belly to earth, -1 back to earth."""
    height: Array = up_components(*(states[..., i] for i in range(3, 7)))[2]
    return height


def attitude_with_up(up: Array) -> Array:
    """One of the attitudes x y z w (4,) whose world up is `up` (3,) in body axes, exact for every unit vector."""
    x, y, z = up
    if z >= 0.0:
        half = np.sqrt(0.5 * (1.0 + z))
        return np.array([0.5 * y / half, -0.5 * x / half, 0.0, half])
    half = np.sqrt(0.5 * (1.0 - z))
    return np.array([half, 0.0, 0.5 * x / half, 0.5 * y / half])


def into_body(attitude: Array, vector: Array) -> Array:
    """A world vector (3,) in the axes of a body with an attitude x y z w (4,)."""
    axis, w = attitude[:3], attitude[3]
    across = 2.0 * np.cross(vector, axis)
    turned: Array = vector + w * across + np.cross(across, axis)
    return turned
