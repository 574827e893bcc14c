# SPDX-License-Identifier: Apache-2.0
"""Sigma points, their weights, and the moments of what they become."""

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.jit import kernel

TURN = 2.0 * np.pi


def weights(m: int, W0: float) -> Array:
    """Weights (2m+1,) of eq:sigp: W0 for the centre, (1 - W0) / 2m for the others; they sum to one."""
    values = np.full(2 * m + 1, (1.0 - W0) / (2 * m))
    values[0] = W0
    return values


@kernel
def spread(centre: Array, root: Array, W0: float, points: Array) -> None:
    """Sigma points (2m+1, m), eq:sigp: centre, centre + columns, centre - columns of sqrt(m / (1 - W0)) S."""
    m = centre.shape[0]
    scale = np.sqrt(m / (1.0 - W0))
    for j in range(m):
        points[0, j] = centre[j]
        for i in range(m):
            points[1 + i, j] = centre[j] + scale * root[j, i]
            points[1 + m + i, j] = centre[j] - scale * root[j, i]


@kernel
def weighted_mean(points: Array, weight: Array, mean: Array) -> None:
    """Mean (n,) of points (p, n) under weights (p,)."""
    for j in range(points.shape[1]):
        total = 0.0
        for i in range(points.shape[0]):
            total += weight[i] * points[i, j]
        mean[j] = total


@kernel
def add_cross_covariance(
    a: Array, mean_a: Array, b: Array, mean_b: Array, weight: Array, covariance: Array
) -> None:
    """Add sum_i W_i (a_i - mean_a)(b_i - mean_b)' to a covariance (n_a, n_b)."""
    for j in range(a.shape[1]):
        for k in range(b.shape[1]):
            total = 0.0
            for i in range(a.shape[0]):
                total += weight[i] * (a[i, j] - mean_a[j]) * (b[i, k] - mean_b[k])
            covariance[j, k] += total


@kernel
def unwrap(outputs: Array, alive: Array, k: int) -> None:
    """Put an angle of all points on the turn of the first that survived."""
    first = 0
    while alive[first] == 0.0:
        first += 1
    for i in range(outputs.shape[0]):
        if alive[i] > 0.0:
            outputs[i, k] -= TURN * np.rint((outputs[i, k] - outputs[first, k]) / TURN)
