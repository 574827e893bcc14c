# SPDX-License-Identifier: Apache-2.0
"""A steady fall linearised in its eight states: two tilts, three body rates, three velocities.

Heading and position are left out: nothing depends on them. Tilts are small rotations of the attitude about two body
axes across the vertical, so that no attitude is singular.
"""

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.plants.skydiver.model import PlantModel
from skydiver_utc.plants.skydiver.steady import HeldBody, SteadyFall

STATES = (
    "tilt to the side",
    "tilt in pitch",
    "roll rate",
    "pitch rate",
    "yaw rate",
    "speed of fall",
    "speed of glide",
    "speed of slide",
)
_STEP = np.array([1e-5] * 2 + [1e-4] * 3 + [1e-3] * 3)
_CONTROL_STEP = 1e-4


def linearise(body: HeldBody, fall: SteadyFall) -> Array:
    """System matrix (8, 8) of the deviations in the order of `STATES` [rad, rad/s, m/s]; central differences."""
    tilts, speeds = tilt_axes(fall.up), velocity_axes(fall)

    def derivative(x: Array) -> Array:
        up = _turned_back(fall.up, x[:2] @ tilts)
        velocity, rates = fall.velocity + x[5:] @ speeds, fall.rates + x[2:5]
        accelerations = body.accelerations(up, velocity, rates)
        # The world's up in body axes moves with up x rates; its part across `up` is a rate of tilt.
        tilting = tilts @ np.cross(np.cross(up, rates), fall.up)
        return np.concatenate([tilting, accelerations[3:], speeds @ accelerations[:3]])

    columns = [
        (derivative(step * unit) - derivative(-step * unit)) / (2.0 * step)
        for step, unit in zip(_STEP, np.eye(8), strict=True)
    ]
    return np.array(columns).T


def control_effect(model: PlantModel, control: Array, fall: SteadyFall) -> Array:
    """Input matrix of the deviations (8, 4), in the order of `STATES`; central differences."""
    speeds = velocity_axes(fall)

    def derivative(changed: Array) -> Array:
        accelerations = HeldBody(model, changed).accelerations(fall.up, fall.velocity, fall.rates)
        return np.concatenate([np.zeros(2), accelerations[3:], speeds @ accelerations[:3]])

    units = _CONTROL_STEP * np.eye(4)
    columns = [(derivative(control + d) - derivative(control - d)) / (2.0 * _CONTROL_STEP) for d in units]
    return np.array(columns).T


def tilt_axes(up: Array) -> Array:
    """Two unit axes (2, 3) across `up`: of a tilt to the side and of a tilt in pitch (the latter nearest to y)."""
    nearest = np.eye(3)[1 if abs(up[1]) < 0.9 else 2]
    pitch = nearest - (nearest @ up) * up
    pitch /= np.linalg.norm(pitch)
    return np.array([np.cross(pitch, up), pitch])


def velocity_axes(fall: SteadyFall) -> Array:
    """Three unit axes (3, 3): along the path, across it in the plane of glide, and sideways."""
    path = fall.velocity / fall.speed
    sideways = tilt_axes(path)[1]
    return np.array([path, np.cross(path, sideways), sideways])


def _turned_back(vector: Array, turn: Array) -> Array:
    """A world direction in the axes of a body that has turned by a rotation vector (Rodrigues' formula)."""
    angle = float(np.linalg.norm(turn))
    if angle == 0.0:
        return vector
    axis = turn / angle
    across = np.cross(axis, vector)
    turned: Array = np.cos(angle) * vector
    turned -= np.sin(angle) * across
    turned += (1.0 - np.cos(angle)) * (axis @ vector) * axis
    return turned
