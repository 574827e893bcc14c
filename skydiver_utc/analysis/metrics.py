# SPDX-License-Identifier: Apache-2.0
"""A run in a few numbers: the object that ``--json`` prints and ``metrics.json`` holds."""

import json
import math
from typing import Any

import numpy as np

from skydiver_utc.analysis.estimation import estimation_metrics
from skydiver_utc.analysis.numbers import finite, largest, recorded, root_mean_square, settled, time_of
from skydiver_utc.analysis.skydiver import skydiver_metrics
from skydiver_utc.arrays import Array
from skydiver_utc.loop.outcome import REACHED_THE_END
from skydiver_utc.loop.run import Run
from skydiver_utc.parameters.nanoseconds import seconds

SCHEMA_VERSION = 3
CONVERGED_SHARE = 0.05


@np.errstate(over="ignore", invalid="ignore")  # of a run that diverges: a figure that overflows is None
def metrics(run: Run) -> dict[str, Any]:
    """Metrics of a run, in the order in which they are printed; an undefined one is None. docs/report.md lists them.

    outputs: of each tracked output in its own unit, over the states from 2 s on; None for a shorter or a diverged run
    convergence_time_s: None where the error ends outside its band, which is 5 % of the reference's amplitude, where the
        amplitude is zero, or where the run was not flown to its end; of all outputs the latest
    control_effort: mean over the steps of sum_j ((u_j - u_j(0)) / (max_j - min_j))^2, u the applied control, u(0) the
        plant's initial one; over the controls with limits on both sides
    diverged_points: steps in which sigma points diverged, and the largest number in one of them
    holes_s: of each stretch of steps that a recording lacks, the first of them, and the first that is there again
    parameter_changes: the band of convergence and the effort's range are those of the scenario at the start
    """
    outputs = (
        {name: _of_output(run, j) for j, name in enumerate(run.tracked_names)} if run.tracks_outputs else {}
    )
    rate = next((found for found in outputs.values() if found["unit"] == "rad/s"), None)
    banded = [name for name, size in zip(run.tracked_names, run.amplitude, strict=True) if size > 0.0]
    times = [outputs[name]["convergence_time_s"] for name in banded if name in outputs]
    return {
        "schema_version": SCHEMA_VERSION,
        "scenario": run.scenario.name,
        "outcome": run.outcome.value,
        "reason": "; ".join(filter(None, (run.reason, *run.warnings))),
        "outputs": outputs,
        "rmse_deg_s": rate and _degrees(rate["rmse"]),
        "max_abs_error_deg_s": rate and _degrees(rate["max_abs_error"]),
        "convergence_time_s": None if None in times else max(times, default=None),
        **skydiver_metrics(run),
        **estimation_metrics(run),
        "control_effort": control_effort(run),
        "status_steps": run.status_steps,
        "diverged_points": {
            "steps": int(np.count_nonzero(run.diverged_points)),
            "largest": int(run.diverged_points.max(initial=0.0)),
        },
        "solve_time_us": _solve_time_us(run.solve_time_s),
        "wall_time_s": finite(run.wall_time_s),
        "simulated_time_s": time_of(run, len(run.states) - 1),
        "missing_steps": run.first_step,
        "begins_at_s": time_of(run, 0),
        "holes_s": [
            [time_of(run, begin - run.first_step), time_of(run, end + 1 - run.first_step)]
            for begin, end in run.holes
        ],
        "parameter_changes": [
            {
                "node": change.node,
                "step": change.step,
                "time_s": seconds(change.step * run.scenario.dt_ns),
                "parameters": dict(change.parameters),
            }
            for change in run.changes
        ],
    }


def to_json(values: dict[str, Any]) -> str:
    """Metrics as JSON text; raises ValueError rather than write a NaN."""
    return json.dumps(values, indent=2, ensure_ascii=False, allow_nan=False)


def _of_output(run: Run, j: int) -> dict[str, Any]:
    name, rows = run.tracked_names[j], settled(run)
    assert run.error is not None
    error = run.error[:, j]
    return {
        "unit": run.plant.units.get(name, "1"),
        "rmse": finite(root_mean_square(error[rows])),
        "max_abs_error": finite(largest(error[rows])),
        "convergence_time_s": convergence_time(run, j),
        "peak": finite(largest(run.output(name)[rows])),
    }


def convergence_time(run: Run, j: int) -> float | None:
    """Time [s] from which on the error of the j-th output stays inside its band, None if it ends outside."""
    band = CONVERGED_SHARE * float(run.amplitude[j])
    if run.error is None or band <= 0.0 or run.outcome not in REACHED_THE_END:
        return None
    outside = np.flatnonzero(~(np.abs(run.error[:, j]) <= band))
    first = int(outside[-1]) + 1 if len(outside) else 0
    return None if first == len(run.error) else time_of(run, first)


def control_effort(run: Run) -> float | None:
    """Time mean of the squared, range-scaled distance of the applied controls from the initial ones."""
    span = run.plant.maximum - run.plant.minimum
    limited = np.isfinite(span)
    distance = (run.applied - run.plant.initial_control())[:, limited] / span[limited]
    effort = np.sum(np.square(distance), axis=1)[recorded(run)[:-1]]
    return finite(float(np.mean(effort))) if len(effort) else None


def _degrees(radians: float | None) -> float | None:
    return None if radians is None else finite(math.degrees(radians))


def _solve_time_us(solve_time_s: Array) -> dict[str, float | None]:
    """Median and 99th percentile of the calls whose time is known [us]."""
    known = solve_time_s[np.isfinite(solve_time_s)] * 1e6
    if not len(known):
        return {"median": None, "p99": None}
    return {"median": finite(float(np.median(known))), "p99": finite(float(np.percentile(known, 99)))}
