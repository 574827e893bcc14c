# SPDX-License-Identifier: Apache-2.0
"""Sensitivity to the tuning: runs with random covariances around the scenario's own."""

import csv
import io
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.analysis.metrics import CONVERGED_SHARE
from skydiver_utc.controllers.utc.settings import UtcSettings
from skydiver_utc.parameters import ParameterError, Parameters, Scenario, leaves, override
from skydiver_utc.studies.cases import Done, Measures, amplitude_deg_s, measure, run_all

# The covariances of UTC, below `controller`.
FACTORS = (
    "Pu.Cm_damp_yaw",
    "Pu.k_right",
    "Pu.k_left",
    "Pu.alpha",
    "coupling.k_right",
    "coupling.k_left",
    "coupling.alpha",
    "Qu_ratio",
    "P_err",
)
_DIGITS = 4  # of a factor, so that a row of the table gives the same run again
_OWN = "own"


class Tuning(NamedTuple):
    """One run of the study: its factors on the scenario's covariances, in the order of FACTORS."""

    factors: tuple[float, ...]
    measures: Measures


class Tunings(NamedTuple):
    """A scenario with its own tuning and with random ones, each covariance times at most `reach` or its inverse."""

    scenario: Scenario
    reach: float
    own: Measures
    random: list[Tuning]


def draw(count: int, seed: int, reach: float) -> NDArray[np.float64]:
    """Factors (count, 9), log-uniform between 1 / reach and reach; a longer draw starts like a shorter one."""
    exponents = np.random.default_rng(seed).uniform(-1.0, 1.0, (count, len(FACTORS)))
    rounded = [[float(f"{reach**e:.{_DIGITS}g}") for e in row] for row in exponents]
    return np.array(rounded)


def check_tunable(scenario: Scenario) -> Scenario:
    """The scenario, if its controller is UTC; raises `ParameterError`."""
    if not isinstance(scenario.controller, UtcSettings):
        raise ParameterError(f"scenario {scenario.name} has no covariances to tune: give one with UTC")
    return scenario


def retuned(scenario: Scenario, factors: Sequence[float]) -> Scenario:
    """The scenario with each covariance times its factor."""
    own = {leaf.name: float(leaf.value) for leaf in leaves(scenario.controller) if leaf.name in FACTORS}  # type: ignore[arg-type]
    return override(
        scenario,
        {f"controller.{name}": own[name] * factor for name, factor in zip(FACTORS, factors, strict=True)},
    )


def tune(scenario: Scenario, reach: float, count: int, seed: int, workers: int, done: Done) -> Tunings:
    """Run a scenario as it is, and with `count` random tunings."""
    factors = draw(count, seed, reach).tolist()
    scenarios = {str(i): retuned(scenario, row) for i, row in enumerate(factors)} | {_OWN: scenario}
    kept = run_all(scenarios, measure, workers, done)
    return Tunings(
        scenario, reach, kept[_OWN], [Tuning(tuple(row), kept[str(i)]) for i, row in enumerate(factors)]
    )


_COLUMNS = ("outcome", "rmse_deg_s", "max_abs_error_deg_s", "convergence_time_s", "control_effort")


def to_csv(tunings: Tunings) -> str:
    """One row per random tuning."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*FACTORS, *_COLUMNS])
    for tuning in tunings.random:
        found = [getattr(tuning.measures, name) for name in _COLUMNS]
        short = [f"{value:.4g}" if isinstance(value, float) else value for value in found]
        writer.writerow([*tuning.factors, *short])
    return text.getvalue()


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
