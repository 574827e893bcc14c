"""How much the tuning matters: random covariances around the scenario's own, and what comes of each flight."""

import csv
import io
from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from skydiver_utc.parameters import ParameterError, Scenario, UtcParameters
from skydiver_utc.studies.runs import Done, Measures, fly_all, measure

# Everything in UTC that is a covariance.
FACTORS = (
    "variance_Cm_damp_yaw",
    "variance_k_right",
    "variance_k_left",
    "variance_alpha",
    "covariance_12",
    "covariance_13",
    "covariance_14",
    "Qu_ratio",
    "P_err",
)
_DIGITS = 4  # of a factor, so that a row of the table flies again as it was flown
_OWN = "own"


class Tuning(NamedTuple):
    """One flight of the study: its factors on the scenario's covariances, in the order of FACTORS."""

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
    """The scenario, if UTC flies it; raises `ParameterError`."""
    if not isinstance(scenario.controller, UtcParameters):
        raise ParameterError(f"scenario {scenario.name} has no covariances to tune: give one that UTC flies")
    return scenario


def retuned(scenario: Scenario, factors: Sequence[float]) -> Scenario:
    """The scenario with each covariance times its factor."""
    controller = scenario.controller
    changed = {
        name: getattr(controller, name) * factor for name, factor in zip(FACTORS, factors, strict=True)
    }
    return msgspec.structs.replace(scenario, controller=msgspec.structs.replace(controller, **changed))


def tune(scenario: Scenario, reach: float, count: int, seed: int, jobs: int, done: Done) -> Tunings:
    """Fly a scenario as it is, and with `count` random tunings."""
    factors = draw(count, seed, reach).tolist()
    flights = {str(i): retuned(scenario, row) for i, row in enumerate(factors)} | {_OWN: scenario}
    kept = fly_all(flights, measure, jobs, done)
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
