# SPDX-License-Identifier: Apache-2.0
"""The eight states that matter to a controller.

Position and heading are left out: nothing depends on them. Attitude is the world's up direction in body axes, of
which x and y suffice while the dorsal axis points above the horizon. Order: up x, up y; roll, pitch and yaw rate
[rad/s]; velocity x, y, z [m/s], all in body axes.
"""

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.jit import unfused
from skydiver_utc.parameters import ParameterError
from skydiver_utc.plants.skydiver.dynamics import STATE_SIZE
from skydiver_utc.plants.skydiver.model import PlantModel
from skydiver_utc.plants.skydiver.steady import straight_falls
from skydiver_utc.rotations import attitude_with_up, up_of_quaternion


def reduced(state: Array) -> Array:
    """The eight states (8,) of a state (13,)."""
    z = np.empty(8)
    _reduce(state, z)
    return z


@unfused
def _reduce(state: Array, z: Array) -> None:
    z[0], z[1], _ = up_of_quaternion(state[3], state[4], state[5], state[6])
    for axis in range(3):
        z[2 + axis], z[5 + axis] = state[10 + axis], state[7 + axis]


def expanded(z: Array) -> Array:
    """A state (13,) at the origin, with the heading free, that has the eight states (8,)."""
    state = np.zeros(STATE_SIZE)
    state[3:7] = attitude_with_up(np.array([z[0], z[1], np.sqrt(1.0 - z[0] ** 2 - z[1] ** 2)]))
    state[10:], state[7:10] = z[2:5], z[5:]
    return state


def belly_to_earth(model: PlantModel) -> Array:
    """Reduced state (8,) of the straight fall at pattern angle 0 in which the belly faces the earth."""
    falls = [fall for fall in straight_falls(model) if fall.facing == "belly to earth"]
    if not falls:
        raise ParameterError("this posture has no straight fall belly to earth: choose another posture")
    return np.concatenate([falls[0].up[:2], falls[0].rates, falls[0].velocity])
