"""One flight in a dozen numbers: the object that ``--json`` prints and ``metrics.json`` holds."""

import json
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.parameters import RotationReference, Scenario
from skydiver_utc.simulation.flight import Flight
from skydiver_utc.simulation.outcome import Outcome, dorsal_axis_height, world_up

SCHEMA_VERSION = 2
SETTLING_S = 2.0
CONVERGED_SHARE = 0.05
# Height of the dorsal axis from which on a body faces the earth with one side: 45 deg from the vertical.
_FACING = math.sqrt(0.5)
FLOWN_TO_ITS_END = (Outcome.COMPLETED, Outcome.ROLLED_OVER)

Floats = NDArray[np.float64]


def metrics(flight: Flight) -> dict[str, Any]:
    """Metrics of a flight, in the order in which they are printed; what is not defined is None.

    rmse_deg_s, max_abs_error_deg_s, peak_yaw_rate_deg_s
        of the tracked body rate (and of the yaw rate), over the states from 2 s on; None for a shorter or a
        diverged flight, errors also for a reference that is for the pattern angle.
    convergence_time_s
        the first time from which on the error stays within 5 % of the reference's amplitude to the end; None
        if there is none, for a reference whose amplitude is zero (5 % of nothing is no band) and for a flight
        that was not flown to its end. A time shortly before the end says little: an error that swings through
        zero may just happen to end inside the band. The time at which a recording begins is the latest that it
        can be.
    control_effort
        mean over the steps of sum_j ((u_j - u_j(0)) / (max_j - min_j))^2, u what the plant applied, u(0) the
        scenario's initial control.
    solve_time_us
        median and 99th percentile of one controller call.
    rmse_rotating_deg_s, angle_error_deg, overshoot_deg
        of a reference that rotates by an angle: RMSE from its start to its end, angle turned at the end of the
        flight less the angle wanted, and how far the angle turned ever went beyond the wanted one; None for
        other references, and for a flight that ends before the rotation does. The angles also for a recording that
        lacks the beginning, its RMSE for one that lacks some of the rotation.
    facing, facing_since_s
        which side faces the earth at the end of a flight, and since when the dorsal axis has stayed within 45
        deg of the vertical for that, at the latest where the recording begins; facing is "neither" where it is not.
    missing_steps, begins_at_s
        steps that a recording lacks before its first one, and the time of that; 0 for a whole flight.
    status_steps
        steps with each status of the controller: solved, saturated, repaired, kept_previous.
    min_dorsal_axis
        lowest height of the dorsal axis: 1 belly to earth, 0 on the side, -1 on the back.
    parameter_changes
        node, step, time and parameters of each change in flight. Errors are those from the reference that was
        flown; the band of convergence and the effort's range are those of the scenario at the start.
    """
    scenario = flight.scenario
    to_its_end = flight.outcome in FLOWN_TO_ITS_END
    yaw_rate = np.rad2deg(flight.yaw_rate)
    error = tracking_error_deg_s(flight)
    settled = slice(row_from(SETTLING_S, flight), len(yaw_rate))
    if flight.outcome is Outcome.DIVERGED:
        settled = slice(len(yaw_rate), len(yaw_rate))
    turned = angle_turned_deg(flight)
    facing, facing_since_s = faces(flight)
    return {
        "schema_version": SCHEMA_VERSION,
        "scenario": scenario.name,
        "outcome": flight.outcome.value,
        "reason": flight.reason,
        "rmse_deg_s": None if error is None else _finite(root_mean_square(error[settled])),
        "max_abs_error_deg_s": None if error is None else _finite(_largest(error[settled])),
        "convergence_time_s": None if error is None or not to_its_end else convergence_time(error, flight),
        "peak_yaw_rate_deg_s": _finite(_largest(yaw_rate[settled])),
        **_of_rotation(error, turned, flight),
        "control_effort": _finite(control_effort(flight.applied, scenario)),
        "status_steps": flight.status_steps,
        "solve_time_us": solve_time_us(flight.solve_time_s),
        "wall_time_s": _finite(flight.wall_time_s),
        "simulated_time_s": _time_s(len(flight.states) - 1, flight),
        "facing": facing,
        "facing_since_s": facing_since_s,
        "min_dorsal_axis": _finite(float(np.min(dorsal_axis_height(flight.states)))),
        "missing_steps": flight.first_step,
        "begins_at_s": _time_s(0, flight),
        "parameter_changes": [
            {
                "node": change.node,
                "step": change.step,
                "time_s": change.step * scenario.dt_ns / 1e9,
                "parameters": dict(change.parameters),
            }
            for change in flight.changes
        ],
    }


def to_json(values: dict[str, Any]) -> str:
    """Metrics as JSON text; raises ValueError rather than write a NaN."""
    return json.dumps(values, indent=2, ensure_ascii=False, allow_nan=False)


def tracking_error_deg_s(flight: Flight) -> Floats | None:
    """Tracked body rate less its reference (K+1,) [deg/s]; None where the reference is for the pattern angle."""
    return None if flight.tracked is None else np.rad2deg(flight.tracked - flight.reference)


def angle_turned_deg(flight: Flight) -> Floats:
    """Angle (K+1,) [deg] turned since the start about the vertical (a yaw rate's reference) or in pitch.

    A heading is that of the body's long axis. A pitch is that of the world's up direction in the body's plane of
    symmetry, so that it passes head down without a jump.
    """
    if flight.scenario.reference.signal == "yaw_rate":
        x, y, z, w = np.moveaxis(flight.states[:, 3:7], -1, 0)
        angle = np.arctan2(2 * (x * y + z * w), 1 - 2 * (y * y + z * z))
    else:
        up = world_up(flight.states)
        angle = np.arctan2(-up[:, 0], up[:, 2])
    turned: Floats = np.rad2deg(np.unwrap(angle))
    turned -= turned[0]
    return turned


def faces(flight: Flight) -> tuple[str, float | None]:
    """Which side faces the earth at the end, and since when [s] without a break."""
    height = dorsal_axis_height(flight.states)
    belly, back = height > _FACING, height < -_FACING
    for side, name in ((belly, "belly to earth"), (back, "back to earth")):
        if side[-1]:
            others = np.flatnonzero(~side)
            first = int(others[-1]) + 1 if len(others) else 0
            return name, _time_s(first, flight)
    return "neither", None


def _of_rotation(error: Floats | None, turned: Floats, flight: Flight) -> dict[str, float | None]:
    reference, scenario = flight.scenario.reference, flight.scenario
    found: dict[str, float | None] = dict.fromkeys(
        ("rmse_rotating_deg_s", "angle_error_deg", "overshoot_deg")
    )
    if error is None or not isinstance(reference, RotationReference):
        return found
    start = first_step_from(reference.start_s, scenario) - flight.first_step
    end = first_step_from(reference.start_s + reference.duration_s, scenario) - flight.first_step
    if end >= len(error):
        return found
    if start >= 0:
        found["rmse_rotating_deg_s"] = _finite(root_mean_square(error[start : end + 1]))
    if flight.first_step == 0:
        wanted = reference.angle_deg
        beyond = float(np.max(np.sign(wanted) * (turned - wanted)))
        found["angle_error_deg"] = _finite(float(turned[-1] - wanted))
        found["overshoot_deg"] = _finite(max(beyond, 0.0))
    return found


def row_from(time_s: float, flight: Flight) -> int:
    """The first row of a flight at or after a time; the first of all where it begins later."""
    return max(0, first_step_from(time_s, flight.scenario) - flight.first_step)


def _time_s(row: int, flight: Flight) -> float:
    return (flight.first_step + row) * flight.scenario.dt_ns / 1e9


def first_step_from(time_s: float, scenario: Scenario) -> int:
    """The first step at or after a time."""
    return math.ceil(round(time_s * 1e9) / scenario.dt_ns)


def root_mean_square(values: Floats) -> float:
    """Root of the mean square, NaN of no values."""
    return math.sqrt(float(np.mean(np.square(values)))) if len(values) else math.nan


def convergence_time(error_deg_s: Floats, flight: Flight) -> float | None:
    """Time [s] from which on the error (K+1,) stays inside its band, None if it ends outside."""
    band = CONVERGED_SHARE * flight.scenario.reference.amplitude_or_level_deg_s
    if band <= 0.0:
        return None
    outside = np.flatnonzero(~(np.abs(error_deg_s) <= band))
    first = int(outside[-1]) + 1 if len(outside) else 0
    return None if first == len(error_deg_s) else _time_s(first, flight)


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
