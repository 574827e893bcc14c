# SPDX-License-Identifier: Apache-2.0
"""The state of a body in moving air, as a kernel."""

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.jit import program
from skydiver_utc.rotations import turn_into_body

Array = NDArray[np.float64]


def in_moving_air(state: Array, carried: Array, gained: Array) -> Array:
    """A state (13,) whose place is carried by (3,) [m] and whose velocity gains (3,) [m/s], both in the world."""
    moved = state.copy()
    _move(moved, carried, gained)
    return moved


@program
def _move(state: Array, carried: Array, gained: Array) -> None:
    in_body = np.empty(3)
    turn_into_body(state[3:7], gained, in_body)
    for axis in range(3):
        state[axis] += carried[axis]
        state[7 + axis] += in_body[axis]
