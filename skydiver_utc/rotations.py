# SPDX-License-Identifier: Apache-2.0
"""Attitudes as quaternions x y z w, body to world."""

from typing import Any

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.jit import kernel


def up_components(x: Any, y: Any, z: Any, w: Any) -> tuple[Any, Any, Any]:
    """The world's up direction in body axes, of a quaternion's components: numbers, arrays or symbols."""
    return 2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)


up_of_quaternion = kernel(up_components)


def world_up(states: Array) -> Array:
    """The world's up direction (..., 3) in body axes for states (..., 13)."""
    return np.stack(up_components(*np.moveaxis(states[..., 3:7], -1, 0)), axis=-1)


def dorsal_axis_height(states: Array) -> Array:
    """Height (...) of the dorsal axis for states (..., 13): 1 belly to earth, -1 back to earth."""
    return up_components(*(states[..., i] for i in range(3, 7)))[2]


def attitude_with_up(up: Array) -> Array:
    """One of the attitudes x y z w (4,) whose world up is `up` (3,) in body axes, exact for every unit vector."""
    x, y, z = up
    if z >= 0.0:
        half = np.sqrt(0.5 * (1.0 + z))
        return np.array([0.5 * y / half, -0.5 * x / half, 0.0, half])
    half = np.sqrt(0.5 * (1.0 - z))
    return np.array([half, 0.0, 0.5 * x / half, 0.5 * y / half])


@kernel
def turn_into_body(attitude: Array, vector: Array, out: Array) -> None:
    """A world vector (3,) in the axes of a body with an attitude x y z w (4,)."""
    _turn(-attitude[0], -attitude[1], -attitude[2], attitude[3], vector, out)


@kernel
def turn_into_world(attitude: Array, vector: Array, out: Array) -> None:
    """A vector (3,) of a body with an attitude x y z w (4,) in the axes of the world."""
    _turn(attitude[0], attitude[1], attitude[2], attitude[3], vector, out)


@kernel
def _turn(x: float, y: float, z: float, w: float, vector: Array, out: Array) -> None:
    a, b, c = vector[0], vector[1], vector[2]
    p, q, r = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    out[0] = a + w * p + y * r - z * q
    out[1] = b + w * q + z * p - x * r
    out[2] = c + w * r + x * q - y * p


@kernel
def turned(attitude: Array, rotation: Array, out: Array) -> None:
    """Attitude x y z w (4,) turned by a rotation vector (3,) [rad] in its own axes."""
    angle = np.sqrt(rotation[0] ** 2 + rotation[1] ** 2 + rotation[2] ** 2)
    share = np.sin(0.5 * angle) / angle if angle > 1e-9 else 0.5
    a, b, c, d = share * rotation[0], share * rotation[1], share * rotation[2], np.cos(0.5 * angle)
    x, y, z, w = attitude[0], attitude[1], attitude[2], attitude[3]
    out[0] = w * a + x * d + y * c - z * b
    out[1] = w * b + y * d + z * a - x * c
    out[2] = w * c + z * d + x * b - y * a
    out[3] = w * d - x * a - y * b - z * c


@kernel
def rotation_between(attitude: Array, other: Array, out: Array) -> None:
    """The rotation vector (3,) [rad], at most half a turn, that turns one attitude x y z w (4,) into another."""
    x, y, z, w = -attitude[0], -attitude[1], -attitude[2], attitude[3]
    a, b, c, d = other[0], other[1], other[2], other[3]
    out[0] = w * a + x * d + y * c - z * b
    out[1] = w * b + y * d + z * a - x * c
    out[2] = w * c + z * d + x * b - y * a
    cosine = w * d - x * a - y * b - z * c
    sine = np.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
    share = 2.0 * np.arctan2(sine, abs(cosine)) / sine if sine > 1e-9 else 2.0
    if cosine < 0.0:
        share = -share
    for i in range(3):
        out[i] *= share
