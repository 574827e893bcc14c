# SPDX-License-Identifier: Apache-2.0
"""The forces of the air on the segments, one by one: those that the equations of motion add up."""

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.body.segments import SEGMENTS
from skydiver_utc.plants.skydiver.dynamics import posture_geometry, segment_drift
from skydiver_utc.plants.skydiver.model import GEOMETRY_SIZE, SEGMENT_COUNT, PlantModel

_NAMES = [segment.name for segment in SEGMENTS]
_HANDS = [_NAMES.index("right_hand"), _NAMES.index("left_hand")]
# The six entries of a segment's drag-area matrix, in the order of the table, as rows.
_ROWS = [[0, 3, 4], [3, 1, 5], [4, 5, 2]]


def segment_forces(model: PlantModel, state: Array, applied: Array) -> Array:
    """Forces (16, 3) [N] in the body frame at a state (13,) under what the actuators hold (5,).

    F = -rho/2 |u| A u of each segment's velocity u in the air, and on the hands what k_right and k_left add along z.
    """
    geometry, drift = np.empty(GEOMETRY_SIZE), np.empty(3 * SEGMENT_COUNT)
    posture_geometry(model, float(applied[3]), geometry)
    segment_drift(model, float(applied[3]), float(applied[4]), drift)
    table = geometry[: 9 * SEGMENT_COUNT].reshape(9, SEGMENT_COUNT)
    velocity = state[7:10] + np.cross(state[10:13], table[:3].T) + drift.reshape(3, SEGMENT_COUNT).T
    pressure = -model.half_density * np.linalg.norm(velocity, axis=1, keepdims=True)
    forces: Array = pressure * np.einsum("abi,ib->ia", table[3:][_ROWS], velocity)
    forces[_HANDS, 2] += model.hand_force * applied[1:3]
    return forces
