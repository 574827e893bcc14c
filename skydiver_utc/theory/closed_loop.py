# SPDX-License-Identifier: Apache-2.0
"""The closed loop of a linear plant under UTC with a constant gain, no bound active.

    u = u_before + K (r - F x - H u_before),    x+ = A x + B u + f

In z = (x, u_before) this is z+ = Z z + (B K r, K r) + (f, 0).
"""

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.plants.linear import LinearModel
from skydiver_utc.theory.linear_plant import to_the_horizon

Array = NDArray[np.float64]


def closed_loop_matrix(plant: LinearModel, K: Array, steps: int) -> Array:
    """Z (n+m, n+m) = [[A - B K F, B (I - K H)], [-K F, I - K H]], F and H of the horizon.

    For one step and C = I this is Z of arXiv 2504.08579, [[(I - B K) A, (I - B K) B], [-K A, I - K B]].
    """
    F, H = to_the_horizon(plant, steps)
    kept = np.eye(len(K)) - K @ H
    return np.block([[plant.A - plant.B @ K @ F, plant.B @ kept], [-K @ F, kept]])


def apart_from_rest(plant: LinearModel, K: Array) -> Array:
    """Orthonormal basis W (n+m, p) of what is across the states of rest of the loop.

    Any (x, u) with x = A x + B u and K C x = 0 stays where it is: Z has the eigenvalue 1 there, at least m - l
    times. The distance from rest is |W'z|, and it moves with W'Z W.
    """
    n, m = plant.B.shape
    conditions = np.block([[plant.A - np.eye(n), plant.B], [K @ plant.C, np.zeros((m, m))]])
    _, values, right = np.linalg.svd(conditions)
    across: Array = right[: int((values > 1e-10 * values[0]).sum())].T
    return across


def decay(matrix: Array) -> float:
    """Spectral radius: by how much what is slowest shrinks in a step."""
    return float(np.abs(np.linalg.eigvals(matrix)).max(initial=0.0))
