# SPDX-License-Identifier: Apache-2.0
"""Whether the estimate of a run can be believed: its errors, and the innovations of its sensors."""

from itertools import pairwise
from typing import Any

import numpy as np

from skydiver_utc.analysis.numbers import finite
from skydiver_utc.arrays import Array
from skydiver_utc.estimators.consistency import Consistency, consistency
from skydiver_utc.estimators.manifold import attitude_of, distance, error_names
from skydiver_utc.loop.run import Run

_INNOVATION, _DEVIATION, _NIS = "innovation_", "deviation_", "nis_"


def sensor_names(run: Run) -> list[str]:
    """The sensors of the estimator whose innovations follow their NIS; none of one that is given the state."""
    return [
        name.removeprefix(_NIS)
        for name, after in pairwise(run.telemetry_names)
        if name.startswith(_NIS) and after.startswith(_INNOVATION)
    ]


def innovations(run: Run, sensor: str) -> Array:
    """Innovations (K, l) of a sensor in units of their standard deviations, NaN where there was none."""
    first = run.telemetry_names.index(_NIS + sensor) + 1
    rest = enumerate(run.telemetry_names[first:], first)
    end = next((i for i, name in rest if not name.startswith(_INNOVATION)), len(run.telemetry_names))
    return run.telemetry[:, first:end]


def consistencies(run: Run) -> dict[str, Consistency]:
    """The verdict on each sensor."""
    return {name: consistency(innovations(run, name)) for name in sensor_names(run)}


def estimation_errors(run: Run) -> dict[str, tuple[Array, Array]]:
    """True less estimated value (K,), and the estimated deviation of this error (K,), by state.

    An attitude's error is a rotation vector in body axes [rad]; biases are not among them.
    """
    names, states = run.telemetry_names, run.plant.state_names
    if not sensor_names(run):
        return {}
    first = names.index(f"estimate_{states[0]}")
    estimates = np.ascontiguousarray(run.telemetry[:, first : first + len(states)])
    attitude = attitude_of(states)
    errors = np.empty((len(estimates), len(states) - (attitude >= 0)))
    angled = getattr(run.scenario.estimator, "angles", ())
    angles = np.array([error_names(states).index(name) for name in angled if name in states], dtype=np.int64)
    for k in range(len(errors)):
        distance(estimates[k], run.states[k], attitude, angles, errors[k])
    deviations = [i for i, name in enumerate(names) if name.startswith(_DEVIATION)][: errors.shape[1]]
    return {
        names[i].removeprefix(_DEVIATION): (errors[:, j], run.telemetry[:, i])
        for j, i in enumerate(deviations)
    }


def estimation_metrics(run: Run) -> dict[str, Any]:
    """Metrics of an estimator that has sensors, none of another; see docs/estimators.md.

    The RMSE of a state is in its unit, of an attitude about body axes in rad; of errors of a filter that is right 0.95
    lie inside two of its deviations.
    """
    sensors = {
        name: {
            "measurements": found.measurements,
            "nis_mean": finite(found.mean),
            "nis_bounds": [finite(found.low), finite(found.high)],
            "correlation": finite(float(np.max(np.abs(found.correlation)))),
            "correlation_bound": finite(found.bound),
            "verdict": found.verdict,
        }
        for name, found in consistencies(run).items()
    }
    if not sensors:
        return {}
    states = {
        name: {
            "rmse": finite(float(np.sqrt(np.nanmean(np.square(error))))),
            "inside_two_deviations": finite(float(np.nanmean(np.abs(error) <= 2.0 * deviation))),
        }
        for name, (error, deviation) in estimation_errors(run).items()
    }
    return {"estimation": {"sensors": sensors, "states": states}}
