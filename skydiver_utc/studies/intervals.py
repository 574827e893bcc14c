# SPDX-License-Identifier: Apache-2.0
"""Intervals with 95 % confidence: of a share, and of a median."""

import math
from collections.abc import Sequence
from statistics import NormalDist

import numpy as np

_RESAMPLES = 2000
_Z = NormalDist().inv_cdf(0.975)


def share_interval(successes: int, count: int) -> tuple[float, float]:
    """Wilson's interval of a share: inside 0 and 1 and of some width also where all runs end alike."""
    total = count + _Z**2
    middle = (successes + 0.5 * _Z**2) / total
    half = _Z / total * math.sqrt(successes * (count - successes) / count + 0.25 * _Z**2)
    return max(middle - half, 0.0), min(middle + half, 1.0)


def median_interval(values: Sequence[float]) -> tuple[float, float, float]:
    """Median, and its interval by the percentiles of a bootstrap with a fixed seed; NaN of no values."""
    from scipy.stats import bootstrap

    given = np.asarray(values, dtype=float)
    if len(given) < 2:
        middle = float(given[0]) if len(given) else float("nan")
        return middle, middle, middle
    found = bootstrap(
        (given,),
        np.median,
        n_resamples=_RESAMPLES,
        method="percentile",
        random_state=np.random.default_rng(1),
    )
    low, high = found.confidence_interval
    return float(np.median(given)), float(low), float(high)
