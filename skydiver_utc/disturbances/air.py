# SPDX-License-Identifier: Apache-2.0
"""The state of a body in moving air, as a kernel."""

from skydiver_utc.arrays import Array
from skydiver_utc.disturbances.protocol import STILL_AIR
from skydiver_utc.jit import program
from skydiver_utc.rotations import turn_into_body


def in_moving_air(state: Array, wind: Array, before: Array, dt_s: float) -> Array:
    """A state (13,) relative to the air, which carries its place over dt_s, where the wind (3,) was another before."""
    if wind is STILL_AIR and before is STILL_AIR:
        return state
    moved = state.copy()
    _move(moved, wind, before - wind, dt_s)
    return moved


@program
def _move(state: Array, wind: Array, gained: Array, dt_s: float) -> None:
    turn_into_body(state[3:7], gained, gained)
    for axis in range(3):
        state[axis] += dt_s * wind[axis]
        state[7 + axis] += gained[axis]
