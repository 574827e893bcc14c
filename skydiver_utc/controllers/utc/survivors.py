# SPDX-License-Identifier: Apache-2.0
"""Sigma points that diverged: the weights of the others, and how far from the centre the next ones are drawn."""

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.jit import kernel

# An output beyond this is lost: its square would overflow.
_LARGEST_OUTPUT = 1e100
# The points' distance from the centre is halved after a loss, and grows by this when none is lost.
_LESS, _MORE, _LEAST_SPREAD = 0.5, 1.1, 1e-6


@kernel
def weights_left(weights: Array, outputs: Array, saved: Array, left: Array, survived: Array) -> int:
    """Weights (2m+1,) without the points that diverged, scaled to the same sum; returns how many those are.

    Beside a negative central weight the others may sum to nothing or less; equal weights take their place then, as
    they do where no weight is left. Lost rows of outputs and saved are overwritten with zeros, survived (2m+1,)
    with 1 and 0.
    """
    lost, total, remaining = 0, 0.0, 0.0
    for i in range(weights.shape[0]):
        alive = True
        for k in range(outputs.shape[1]):
            alive = alive and abs(outputs[i, k]) <= _LARGEST_OUTPUT
        for c in range(saved.shape[1]):
            alive = alive and abs(saved[i, c]) <= _LARGEST_OUTPUT
        total += weights[i]
        left[i] = survived[i] = alive
        if alive:
            remaining += weights[i]
        else:
            lost += 1
            for k in range(outputs.shape[1]):
                outputs[i, k] = 0.0
            for c in range(saved.shape[1]):
                saved[i, c] = 0.0
    equal = lost > 0 and (weights[0] < 0.0 or remaining == 0.0)
    for i in range(weights.shape[0]):
        if left[i] > 0.0:
            left[i] = total / (weights.shape[0] - lost) if equal else weights[i] * (total / remaining)
    return lost


@kernel
def next_spread(now: float, alive: Array, lost: int) -> float:
    """The share of their distance at which the next points are drawn.

    Halved where the centre survives and a pair of points beside it does not, or any point once it is below one. Where
    the centre diverges the survivors show the way, and where all diverge the search begins anew.
    """
    if lost == 0:
        return min(1.0, _MORE * now)
    if lost == alive.shape[0]:
        return 1.0
    m, whole = (alive.shape[0] - 1) // 2, now == 1.0
    for j in range(m):
        whole = whole and alive[1 + j] + alive[1 + m + j] > 0.0
    return now if whole or alive[0] == 0.0 else max(_LESS * now, _LEAST_SPREAD)


@kernel
def survived_range(saved: Array, alive: Array, a: int, low: float, high: float) -> tuple[float, float]:
    """The range of a control among the points that survived, inside its bounds."""
    least, most = np.inf, -np.inf
    for i in range(alive.shape[0]):
        if alive[i] > 0.0:
            least, most = min(least, saved[i, a]), max(most, saved[i, a])
    return max(low, least), min(high, most)
