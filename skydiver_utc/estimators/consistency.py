# SPDX-License-Identifier: Apache-2.0
"""Whether a filter's innovations are as large, and as independent of each other, as it expects."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from skydiver_utc.arrays import Array

JUDGEMENT = ("nis_mean", "nis_low", "nis_high", "verdict")  # telemetry, each with `_<sensor>`
_LEAST = 20  # measurements for a verdict
# By number in a node's telemetry.
VERDICTS = ("too few", "consistent", "overconfident", "cautious", "not white")


class Consistency(NamedTuple):
    """Of a sensor: how many measurements of how many numbers.

    mean: of their normalised innovation squared (NIS); low, high: between which it lies in 95 % of the runs of a
        filter that is right: the chi-square distribution with measurements * size degrees of freedom, over measurements
    correlation (size,): of each innovation with that of the next measurement; bound: below which all of these stay
        in 95 % of such runs
    verdict: consistent; overconfident: errors are larger than the filter expects; cautious: smaller; not white:
        consecutive innovations are correlated, as with a bias or a wrong model; too few
    """

    measurements: int
    size: int
    mean: float
    low: float
    high: float
    correlation: Array
    bound: float
    verdict: str


def consistency(innovations: Array) -> Consistency:
    """Of innovations (K, l) in units of their standard deviations; rows with NaN do not count."""
    found = innovations[np.isfinite(innovations).all(axis=1)]
    count, size = found.shape
    if count < _LEAST:
        nothing = np.full(size, np.nan)
        return Consistency(count, size, np.nan, np.nan, np.nan, nothing, np.nan, "too few")
    mean = float(np.mean(np.sum(np.square(found), axis=1)))
    low, high, bound = _bounds(count, size)
    correlations = correlation(found, 1)
    verdict = "consistent"
    if mean > high:
        verdict = "overconfident"
    elif mean < low:
        verdict = "cautious"
    elif np.abs(correlations).max() > bound:
        verdict = "not white"
    return Consistency(count, size, mean, low, high, correlations, bound, verdict)


@lru_cache
def _bounds(count: int, size: int) -> tuple[float, float, float]:
    from scipy.stats import chi2, norm

    low, high = (float(chi2.ppf(share, count * size)) / count for share in (0.025, 0.975))
    return low, high, float(norm.ppf(1.0 - 0.025 / size)) / float(np.sqrt(count))


def correlation(innovations: Array, lag: int) -> Array:
    """Autocorrelation (l,) at a lag of innovations (K, l) whose mean is expected to be zero."""
    products = np.sum(innovations[lag:] * innovations[:-lag], axis=0)
    return products / np.sum(np.square(innovations), axis=0)
