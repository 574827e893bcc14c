# SPDX-License-Identifier: Apache-2.0
"""Intervals with 95 % confidence: of a share, and of a median."""

from collections.abc import Sequence

import numpy as np

_RESAMPLES = 2000


def share_interval(successes: int, count: int) -> tuple[float, float]:
    """Wilson's interval of a share: inside 0 and 1 and of some width also where all runs end alike."""
    from scipy.stats import binomtest

    found = binomtest(successes, count).proportion_ci(method="wilson")
    return float(found.low), float(found.high)


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
