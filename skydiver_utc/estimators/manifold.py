# SPDX-License-Identifier: Apache-2.0
"""States with an attitude: its four numbers change by a rotation vector of three, all others by addition.

In an error (e,) of a state (N,) the rotation vector stands where the quaternion x y z w begins, at index `attitude`;
-1: there is none. Of states with no attitude e = N.
"""

import numpy as np

from skydiver_utc.arrays import Array, Integers
from skydiver_utc.jit import kernel
from skydiver_utc.rotations import rotation_between, turned
from skydiver_utc.unscented.sigma_points import TURN


@kernel
def moved(state: Array, error: Array, attitude: int, out: Array) -> None:
    """The state (N,) at a distance (e,) from another one; out may be that one."""
    for i in range(state.shape[0]):
        if attitude < 0 or i < attitude:
            out[i] = state[i] + error[i]
        elif i >= attitude + 4:
            out[i] = state[i] + error[i - 1]
    if attitude >= 0:
        turned(state[attitude : attitude + 4], error[attitude : attitude + 3], out[attitude : attitude + 4])


@kernel
def distance(state: Array, other: Array, attitude: int, angles: Integers, out: Array) -> None:
    """The error (e,) that moves one state (N,) to another; those of `angles` (e's indices) are on the circle."""
    for i in range(state.shape[0]):
        if attitude < 0 or i < attitude:
            out[i] = other[i] - state[i]
        elif i >= attitude + 4:
            out[i - 1] = other[i] - state[i]
    for a in range(angles.shape[0]):
        out[angles[a]] -= TURN * np.rint(out[angles[a]] / TURN)
    if attitude >= 0:
        rotation_between(
            state[attitude : attitude + 4], other[attitude : attitude + 4], out[attitude : attitude + 3]
        )


def error_names(names: tuple[str, ...]) -> tuple[str, ...]:
    """Names of the errors of states with these names."""
    at = attitude_of(names)
    return names if at < 0 else (*names[:at], "attitude_x", "attitude_y", "attitude_z", *names[at + 4 :])


def attitude_of(names: tuple[str, ...]) -> int:
    """Index of the quaternion qx, qy, qz, qw among the states' names, -1 where there is none."""
    quaternion = ("qx", "qy", "qz", "qw")
    return next((i for i in range(len(names)) if names[i : i + 4] == quaternion), -1)
