"""The eight states that matter to a controller, and one control period linearised in them.

Position and heading are left out: nothing depends on them. Attitude is the world's up direction in body axes, of
which x and y suffice while the dorsal axis points above the horizon. Order: up x, up y; roll, pitch and yaw rate
[rad/s]; velocity x, y, z [m/s], all in body axes.
"""

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.parameters import ParameterError
from skydiver_utc.plant.dynamics import STATE_SIZE, WORK_SIZE, rk4_step
from skydiver_utc.plant.model import PlantModel
from skydiver_utc.plant.steady import SteadyFall, straight_falls

Array = NDArray[np.float64]

REDUCED_SIZE = 8
_STATE_STEP = np.array([1e-5] * 2 + [1e-4] * 3 + [1e-3] * 3)
_CONTROL_STEP = 1e-5


def reduced(state: Array) -> Array:
    """The eight states (8,) of a state (13,)."""
    x, y, z, w = state[3:7]
    up = (2.0 * (x * z - y * w), 2.0 * (y * z + x * w))
    return np.concatenate([up, state[10:13], state[7:10]])


def reduced_rate_at(index: int) -> int:
    """Where the body rate at an index of the state (13,) is in the eight."""
    return index - 8


def expanded(z: Array) -> Array:
    """A state (13,) at the origin, with the heading free, that has the eight states (8,)."""
    half = np.sqrt(0.5 * (1.0 + np.sqrt(1.0 - z[0] ** 2 - z[1] ** 2)))
    state = np.zeros(STATE_SIZE)
    state[3], state[4], state[6] = 0.5 * z[1] / half, -0.5 * z[0] / half, half
    state[10:13], state[7:10] = z[2:5], z[5:8]
    return state


def linearised_step(model: PlantModel, z: Array, control: Array) -> tuple[Array, Array]:
    """A (8, 8) and B (8, 4) of one dt about a reduced state and a control; central differences."""
    work, following = np.empty(WORK_SIZE), np.empty(STATE_SIZE)

    def step(z: Array, control: Array) -> Array:
        rk4_step(model, expanded(z), control, following, work)
        return reduced(following)

    A = [(step(z + d, control) - step(z - d, control)) / 2.0 for d in np.diag(_STATE_STEP)]
    B = [(step(z, control + d) - step(z, control - d)) / 2.0 for d in _CONTROL_STEP * np.eye(4)]
    return np.array(A).T / _STATE_STEP, np.array(B).T / _CONTROL_STEP


def belly_to_earth(model: PlantModel) -> Array:
    """Reduced state (8,) of the straight fall at pattern angle 0 in which the belly faces the earth."""
    falls = [fall for fall in straight_falls(model) if fall.facing == "belly to earth"]
    if not falls:
        raise ParameterError("this posture has no straight fall belly to earth: choose another posture")
    return _of_fall(falls[0])


def _of_fall(fall: SteadyFall) -> Array:
    return np.concatenate([fall.up[:2], fall.rates, fall.velocity])
