# SPDX-License-Identifier: Apache-2.0
"""The state of a body in moving air, as a kernel."""

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.jit import program

Array = NDArray[np.float64]


@program
def in_moving_air(state: Array, carried: Array, gained: Array) -> Array:
    """A state (13,) whose place is carried by (3,) [m] and whose velocity gains (3,) [m/s], both in the world."""
    moved = state.copy()
    x, y, z, w = state[3], state[4], state[5], state[6]
    a, b, c = gained[0], gained[1], gained[2]
    i, j, k = 2.0 * (z * b - y * c), 2.0 * (x * c - z * a), 2.0 * (y * a - x * b)
    moved[7] += a + w * i + (z * j - y * k)
    moved[8] += b + w * j + (x * k - z * i)
    moved[9] += c + w * k + (y * i - x * j)
    for axis in range(3):
        moved[axis] += carried[axis]
    return moved
