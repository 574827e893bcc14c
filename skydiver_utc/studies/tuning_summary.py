# SPDX-License-Identifier: Apache-2.0
"""Counts and correlations over many random tunings."""

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.analysis.metrics import CONVERGED_SHARE
from skydiver_utc.parameters import Parameters, Scenario
from skydiver_utc.studies.cases import Measures, amplitude_deg_s
from skydiver_utc.studies.tuning import FACTORS, Tunings

_FAST_S = 2.0
_QUANTILES = (0.05, 0.5, 0.95)


class TuningSummary(Parameters):
    """One scenario under `count` random tunings, each covariance within a factor `reach`.

    completed: to the end, belly to earth. converged: completed, and inside 5 % of the amplitude for good from
    the first half of the flight on; by_2_s: from 2 s on. tracked: RMSE at most 5 % of the amplitude.
    rmse_quantiles: what 5 %, 50 %, 95 % stay below [deg/s]; own_rmse is that of the scenario's own tuning.
    influence: Spearman's rank correlation of each factor with the RMSE.
    """

    scenario: str
    reach: float
    count: int
    completed: int
    converged: int
    converged_by_2_s: int
    tracked: int
    kept_previous_steps: int
    rmse_quantiles: tuple[float | None, float | None, float | None]
    own_rmse: float | None
    better_than_own: int
    influence: dict[str, float]

    @property
    def label(self) -> str:
        """The scenario and the reach in words."""
        return f"{self.scenario}, factor {self.reach:g}"


def summarise(tunings: Tunings) -> TuningSummary:
    """Count and correlate."""
    scenario, found = tunings.scenario, [tuning.measures for tuning in tunings.random]
    rmse = np.array([one.rmse for one in found])
    converged_at = np.array([one.converged_at for one in found])
    converged = np.array([_has_converged(scenario, one) for one in found])
    bar = CONVERGED_SHARE * amplitude_deg_s(scenario)
    # A value of the sample and not one between two, which does not exist beside a flight without an RMSE.
    quantiles = np.quantile(rmse, _QUANTILES, method="inverted_cdf")
    low, middle, high = (float(q) if np.isfinite(q) else None for q in quantiles)
    return TuningSummary(
        scenario=scenario.name,
        reach=tunings.reach,
        count=len(found),
        completed=sum(one.outcome == "completed" for one in found),
        converged=int(np.sum(converged)),
        converged_by_2_s=int(np.sum(converged & (converged_at <= _FAST_S))),
        tracked=int(np.sum(rmse <= bar)),
        kept_previous_steps=sum(one.status_steps["kept_previous"] for one in found),
        rmse_quantiles=(low, middle, high),
        own_rmse=tunings.own.rmse_deg_s,
        better_than_own=int(np.sum(rmse < tunings.own.rmse)),
        influence=_influence(tunings, rmse),
    )


def _has_converged(scenario: Scenario, one: Measures) -> bool:
    """Whether a run converged, and not by chance shortly before its end."""
    return one.outcome == "completed" and one.converged_at <= 0.5 * scenario.duration_s


def _influence(tunings: Tunings, rmse: NDArray[np.float64]) -> dict[str, float]:
    from scipy.stats import spearmanr

    factors = np.array([tuning.factors for tuning in tunings.random])
    correlations = [float(spearmanr(column, rmse).statistic) for column in factors.T]
    return {name: round(found, 3) for name, found in zip(FACTORS, correlations, strict=True)}
