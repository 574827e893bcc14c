"""What many random tunings say together."""

from collections.abc import Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from skydiver_utc.analysis.metrics import CONVERGED_SHARE
from skydiver_utc.parameters import Scenario
from skydiver_utc.studies.runs import Measures
from skydiver_utc.studies.tuning import FACTORS, Tuning

_FAST_S = 2.0
_QUANTILES = (0.05, 0.5, 0.95)


class TuningSummary(msgspec.Struct, frozen=True):
    """One scenario under `count` random tunings.

    completed: flown to the end, belly to earth. converged: completed, and inside 5 % of the amplitude for good from
    the first half of the flight on; by_2_s: from 2 s on. tracked: RMSE at most 5 % of the amplitude.
    rmse_quantiles: 5 %, 50 %, 95 % [deg/s]. Rank correlation (Spearman's) of each factor with the RMSE; by thirds
    of each factor, low to high, the share that converged.
    """

    count: int
    completed: int
    converged: int
    converged_by_2_s: int
    tracked: int
    kept_previous_steps: int
    rmse_quantiles: tuple[float, float, float]
    rank_correlation: dict[str, float]
    converged_by_thirds: dict[str, tuple[float, float, float]]


def summarise(scenario: Scenario, tunings: Sequence[Tuning]) -> TuningSummary:
    """Count and correlate."""
    found = [tuning.measures for tuning in tunings]
    factors = np.array([tuning.factors for tuning in tunings])
    rmse = np.array([one.rmse for one in found])
    converged = np.array([has_converged(scenario, one) for one in found])
    bar = CONVERGED_SHARE * scenario.reference.amplitude_or_level_deg_s
    columns = dict(zip(FACTORS, factors.T, strict=True))
    return TuningSummary(
        count=len(found),
        completed=sum(one.outcome == "completed" for one in found),
        converged=int(converged.sum()),
        converged_by_2_s=int(np.sum(converged & (np.array([one.converged_at for one in found]) <= _FAST_S))),
        tracked=int(np.sum(rmse <= bar)),
        kept_previous_steps=sum(one.status_steps["kept_previous"] for one in found),
        rmse_quantiles=_quantiles(rmse),
        rank_correlation={name: _rank_correlation(column, rmse) for name, column in columns.items()},
        converged_by_thirds={name: _by_thirds(column, converged) for name, column in columns.items()},
    )  # fmt: skip


def has_converged(scenario: Scenario, one: Measures) -> bool:
    """Whether a flight converged, and not by chance shortly before its end."""
    return one.outcome == "completed" and one.converged_at <= 0.5 * scenario.duration_s


def _quantiles(values: NDArray[np.float64]) -> tuple[float, float, float]:
    low, middle, high = (float(f"{q:.4g}") for q in np.quantile(values, _QUANTILES))
    return low, middle, high


def _rank_correlation(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    from scipy.stats import spearmanr

    return round(float(spearmanr(a, b).statistic), 3)


def _by_thirds(column: NDArray[np.float64], converged: NDArray[np.bool_]) -> tuple[float, float, float]:
    thirds = np.array_split(converged[np.argsort(column, kind="stable")], 3)
    low, middle, high = (round(float(third.mean()), 3) if len(third) else 0.0 for third in thirds)
    return low, middle, high
