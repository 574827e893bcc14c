# SPDX-License-Identifier: Apache-2.0
"""The few postures of a recorded motion that a smooth path through them needs to be as good as all of them."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Keyframes(NamedTuple):
    """Rows that were kept, rising, and the largest error [rad] of the path at those that were not."""

    kept: NDArray[np.intp]
    error: float


def thin(time_s: Array, angles: Array, tolerance: float) -> Keyframes:
    """Rows of postures (n, 45) [rad] whose piecewise cubics, a path's, meet all others to a tolerance [rad].

    From the first and the last on, each stretch that misses the tolerance is given its worst row, until none does.
    """
    from scipy.interpolate import PchipInterpolator

    kept = np.array([0, len(time_s) - 1])
    while True:
        path = PchipInterpolator(time_s[kept], angles[kept])
        errors = np.abs(path(time_s) - angles).max(axis=1)
        errors[kept] = 0.0
        stretches = [(left + 1, right) for left, right in pairwise(kept) if right > left + 1]
        worst = [left + int(errors[left:right].argmax()) for left, right in stretches]
        missing = [row for row in worst if errors[row] > tolerance]
        if not missing:
            return Keyframes(kept, float(errors.max()))
        kept = np.union1d(kept, missing)
