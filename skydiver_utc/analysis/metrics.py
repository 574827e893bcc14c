"""One flight in a dozen numbers: the object that ``--json`` prints and ``metrics.json`` holds."""

import json
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.parameters import Scenario
from skydiver_utc.simulation.flight import Flight
from skydiver_utc.simulation.outcome import Outcome, dorsal_axis_height

SCHEMA_VERSION = 1
SETTLING_S = 2.0
CONVERGED_SHARE = 0.05
FLOWN_TO_ITS_END = (Outcome.COMPLETED, Outcome.ROLLED_OVER)

Floats = NDArray[np.float64]


def metrics(flight: Flight) -> dict[str, Any]:
    """Metrics of a flight, in the order in which they are printed; what is not defined is None.

    rmse_deg_s, max_abs_error_deg_s, peak_yaw_rate_deg_s
        of the yaw rate, over the states from 2 s on; None for a shorter or a diverged flight.
    convergence_time_s
        the first time from which on the error stays within 5 % of the reference's amplitude to the end; None
        if there is none, for a reference whose amplitude is zero (5 % of nothing is no band) and for a flight
        that was not flown to its end. A time shortly before the end says little: an error that swings through
        zero may just happen to end inside the band.
    control_effort
        mean over the steps of sum_j ((u_j - u_j(0)) / (max_j - min_j))^2, u what the plant applied, u(0) the
        scenario's initial control.
    solve_time_us
        median and 99th percentile of one controller call.
    min_dorsal_axis
        lowest height of the dorsal axis: 1 belly to earth, 0 on the side, -1 on the back.
    """
    scenario = flight.scenario
    steps = len(flight.states) - 1
    to_its_end = flight.outcome in FLOWN_TO_ITS_END
    yaw_rate = np.rad2deg(flight.yaw_rate)
    error = yaw_rate - np.rad2deg(flight.reference)
    settled = slice(first_step_from(SETTLING_S, scenario), len(error))
    if flight.outcome is Outcome.DIVERGED:
        settled = slice(len(error), len(error))
    return {
        "schema_version": SCHEMA_VERSION,
        "scenario": scenario.name,
        "outcome": flight.outcome.value,
        "reason": flight.reason,
        "rmse_deg_s": _finite(root_mean_square(error[settled])),
        "max_abs_error_deg_s": _finite(_largest(error[settled])),
        "convergence_time_s": convergence_time(error, scenario) if to_its_end else None,
        "peak_yaw_rate_deg_s": _finite(_largest(yaw_rate[settled])),
        "control_effort": _finite(control_effort(flight.applied, scenario)),
        "solve_time_us": solve_time_us(flight.solve_time_s),
        "wall_time_s": _finite(flight.wall_time_s),
        "simulated_time_s": steps * scenario.dt_ns / 1e9,
        "min_dorsal_axis": _finite(float(np.min(dorsal_axis_height(flight.states)))),
    }


def to_json(values: dict[str, Any]) -> str:
    """Metrics as JSON text; raises ValueError rather than write a NaN."""
    return json.dumps(values, indent=2, ensure_ascii=False, allow_nan=False)


def first_step_from(time_s: float, scenario: Scenario) -> int:
    """The first step at or after a time."""
    return math.ceil(round(time_s * 1e9) / scenario.dt_ns)


def root_mean_square(values: Floats) -> float:
    """Root of the mean square, NaN of no values."""
    return math.sqrt(float(np.mean(np.square(values)))) if len(values) else math.nan


def convergence_time(error_deg_s: Floats, scenario: Scenario) -> float | None:
    """Time [s] from which on the error (K+1,) stays inside its band, None if it ends outside."""
    band = CONVERGED_SHARE * scenario.reference.amplitude_or_level_deg_s
    if band <= 0.0:
        return None
    outside = np.flatnonzero(~(np.abs(error_deg_s) <= band))
    first = int(outside[-1]) + 1 if len(outside) else 0
    return None if first == len(error_deg_s) else first * scenario.dt_ns / 1e9


def control_effort(applied: Floats, scenario: Scenario) -> float:
    """Time mean of the squared, range-scaled distance of the controls (K, 4) from the initial control."""
    if not len(applied):
        return math.nan
    initial, limits = scenario.initial, scenario.plant.limits
    start = np.array([initial.Cm_damp_yaw, initial.k_right, initial.k_left, initial.alpha])
    span = np.subtract(limits.maximum, limits.minimum)
    return float(np.mean(np.sum(np.square((applied - start) / span), axis=1)))


def solve_time_us(solve_time_s: Floats) -> dict[str, float | None]:
    """Median and 99th percentile of the calls whose time is known [us]."""
    known = solve_time_s[np.isfinite(solve_time_s)] * 1e6
    if not len(known):
        return {"median": None, "p99": None}
    return {"median": float(np.median(known)), "p99": float(np.percentile(known, 99))}


def _largest(values: Floats) -> float:
    return float(np.max(np.abs(values))) if len(values) else math.nan


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
