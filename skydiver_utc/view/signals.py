# SPDX-License-Identifier: Apache-2.0
"""The signals of a run as the curves of a report, by chart and section."""

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from skydiver_utc.analysis.metrics import CONVERGED_SHARE
from skydiver_utc.analysis.units import disturbance_words, shown, shown_disturbance
from skydiver_utc.arrays import Array, Flags, Integers
from skydiver_utc.loop.run import Run

_BUCKETS = 600  # of a curve, each with its smallest and its largest value
_MOST_CURVES = 4  # of a chart: as many as there are colours
_LARGEST = 1e30  # of an axis
_DEVIATION = "std_"
# Telemetry of an estimator: normalised innovation squared, by sensor; estimates and their deviations, by state.
_NIS, _ESTIMATE, _ESTIMATED = "nis_", "estimate_", "deviation_"
_OF_ESTIMATOR = (_NIS, _ESTIMATE, _ESTIMATED, "innovation_")


class Signal(NamedTuple):
    """A curve of a chart: one value (K or K+1,) for each step.

    role: value, reference, command, or band (`values` then with the lower and upper edge, (2, K)); held: the value
    stays until the next step
    """

    section: str
    chart: str
    unit: str
    name: str
    values: Array
    role: str = "value"
    held: bool = False
    limits: tuple[float, float] | None = None


def signals(run: Run) -> list[Signal]:
    """All signals of a run; of disturbances and telemetry those that are not zero throughout."""
    body = _motion(run) if run.plant.state_message == "odometry" else _states(run)
    some = [one for one in (*_disturbances(run), *_calls(run)) if np.nan_to_num(one.values).any()]
    return [*_tracked(run), *_controls(run), *body, *some, *_estimates(run)]


def _tracked(run: Run) -> Iterator[Signal]:
    for j, name in enumerate(run.tracked_names):
        scale = shown(run.plant, name)
        if run.error is None:  # the reference is of a control
            continue
        band = scale.factor * CONVERGED_SHARE * float(run.amplitude[j])
        limits = (-band, band) if band > 0.0 else None
        wanted, error = scale.factor * run.reference[:, j], scale.factor * run.error[:, j]
        yield Signal("Tracking", scale.name, scale.unit, "reference", wanted, "reference")
        yield Signal("Tracking", scale.name, scale.unit, scale.name, scale.factor * run.output(name))
        yield Signal("Tracking", f"{scale.name}: error", scale.unit, "error", error, limits=limits)


def _controls(run: Run) -> Iterator[Signal]:
    plant = run.plant
    for j, name in enumerate(plant.control_names):
        scale = shown(plant, name, degrees=False)
        limits = float(plant.minimum[j]), float(plant.maximum[j])
        section, command = ("Controls", scale.name, scale.unit), run.commands[:, j]
        if f"{_DEVIATION}{name}" in run.telemetry_names:
            deviation = run.telemetry[:, run.telemetry_names.index(f"{_DEVIATION}{name}")]
            edges = np.stack([command - deviation, command + deviation])
            yield Signal(*section, "one standard deviation", edges, "band", True)
        yield Signal(*section, "command", command, "command", True)
        yield Signal(*section, scale.name, run.applied[:, j], "value", True, limits)


def _motion(run: Run) -> Iterator[Signal]:
    """Of a body with a pose: rates, attitude and speed."""
    from scipy.spatial.transform import Rotation

    states, valid = run.states, posed(run)
    for name, column in (("about x, roll", 10), ("about y, pitch", 11), ("about z, yaw", 12)):
        yield Signal("Body", "body rates", "deg/s", name, np.rad2deg(states[:, column]))
    if not valid.any():
        return
    attitude = Rotation.from_quat(states[valid, 3:7])
    angles = np.full((len(states), 3), np.nan)
    angles[valid] = np.unwrap(np.rad2deg(attitude.as_euler("ZYX")), axis=0, period=360.0)
    for name, column in (("heading", 0), ("pitch", 1), ("bank", 2)):
        yield Signal("Body", "attitude", "deg", name, angles[:, column])
    velocity = np.full((len(states), 3), np.nan)
    velocity[valid] = attitude.apply(states[valid, 7:10])
    yield Signal("Body", "speed", "m/s", "downwards", -velocity[:, 2])
    yield Signal("Body", "speed", "m/s", "horizontal", np.hypot(velocity[:, 0], velocity[:, 1]))


def _states(run: Run) -> Iterator[Signal]:
    """Of any other plant: its states, and outputs that are neither states nor tracked, by unit."""
    plant = run.plant
    others = [n for n in plant.output_names if n not in (*plant.state_names, *run.tracked_names)]
    drawn: Counter[str] = Counter()
    for name in (*plant.state_names, *others):
        scale = shown(plant, name)
        state = name in plant.state_names
        values = run.states[:, plant.state_names.index(name)] if state else run.output(name)
        chart = f"{'states' if state else 'outputs'}{'' if scale.unit == '1' else f' in {scale.unit}'}"
        number, drawn[chart] = drawn[chart] // _MOST_CURVES + 1, drawn[chart] + 1
        title = chart if number == 1 else f"{chart}, {number}"
        yield Signal("Plant", title, scale.unit, scale.name, scale.factor * values)


def _disturbances(run: Run) -> Iterator[Signal]:
    """Wind, measured less true state, and pushes, by unit."""
    for name, values in zip(run.disturbance_names, run.disturbance.T, strict=True):
        scale, chart = shown_disturbance(run.plant, name), disturbance_words(name)
        yield Signal("Disturbances", chart, scale.unit, scale.name, scale.factor * values, held=True)


def _calls(run: Run) -> Iterator[Signal]:
    """Of the controller: the time of its calls, and its telemetry."""
    yield Signal("Controller", "solve time", "us", "solve time", 1e6 * run.solve_time_s)
    for name, values in zip(run.telemetry_names, run.telemetry.T, strict=True):
        first, _, rest = name.partition("_")
        if first in ("predicted", "innovation") and rest in run.plant.output_names:
            scale = shown(run.plant, rest)
            yield Signal("Controller", first, scale.unit, scale.name, scale.factor * values, "value", True)
        elif not name.startswith((_DEVIATION, *_OF_ESTIMATOR)):
            words = name.replace("_", " ")
            yield Signal("Controller", words, "1", words, values, "value", True)


def _estimates(run: Run) -> Iterator[Signal]:
    """Of an estimator with sensors: whether its innovations and its errors are as large as it expects."""
    telemetry = dict(zip(run.telemetry_names, run.telemetry.T, strict=True))
    for name, values in telemetry.items():
        if name.startswith(_NIS):
            sensor = name.removeprefix(_NIS).replace("_", " ")
            yield Signal("Estimator", f"{sensor}: innovation squared (NIS)", "1", "NIS", values)
    for state, actual in zip(run.plant.state_names, run.states[:-1].T, strict=True):
        if _ESTIMATE + state not in telemetry or _ESTIMATED + state not in telemetry:
            continue
        scale = shown(run.plant, state)
        chart = "Estimator", f"{scale.name}: error of the estimate", scale.unit
        deviation = 2.0 * scale.factor * telemetry[_ESTIMATED + state]
        yield Signal(*chart, "two deviations", np.stack([-deviation, deviation]), "band")
        yield Signal(*chart, "error", scale.factor * (actual - telemetry[_ESTIMATE + state]))


def posed(run: Run) -> Flags:
    """The rows of a run's states (K+1,) that are numbers, with an attitude where the state has one."""
    known: Flags = np.logical_and.reduce(np.isfinite(run.states), axis=1)
    if run.plant.state_message == "odometry":
        known &= np.linalg.norm(run.states[:, 3:7], axis=1) > 0.0
    return known


def decimated(values: Array) -> Integers:
    """Indices of the smallest and the largest value of each of at most 600 equal stretches, in order.

    A stretch without a value keeps its first, so that a hole stays one. values: (K,) or (2, K), of which the lower
    and the upper row count.
    """
    count = values.shape[-1]
    if count <= 2 * _BUCKETS:
        return np.arange(count)
    low, high = values if values.ndim == 2 else (values, values)
    kept = [0, count - 1]
    for rows in np.array_split(np.arange(count), _BUCKETS):
        some = rows[np.isfinite(low[rows])]
        kept += [some[low[some].argmin()], some[high[some].argmax()]] if len(some) else [rows[0]]
    return np.unique(kept)


@np.errstate(over="ignore", invalid="ignore")
def charts(runs: Sequence[Run], names: Sequence[str]) -> list[dict[str, Any]]:
    """The charts of one run, or of several over each other, as plain data; curves are arrays.

    Of several runs each signal has a chart of its own with one curve for each run, and the reference of the first.
    """
    found: dict[tuple[str, str, str], dict[str, Any]] = {}
    alone = len(runs) == 1
    for number, run in enumerate(runs):
        of_run = signals(run)
        curves = Counter(one.chart for one in of_run if one.role == "value")
        for one in of_run:
            if not alone and (one.role in ("band", "command") or (one.role == "reference" and number)):
                continue
            title = f"{one.chart}: {one.name}" if not alone and curves[one.chart] > 1 else one.chart
            chart = found.setdefault(
                (one.section, title, one.unit),
                {"section": one.section, "title": title, "unit": one.unit, "limits": None, "curves": []},
            )
            chart["limits"] = chart["limits"] or _drawable(one.limits)
            name = one.name if alone or one.role == "reference" else names[number]
            chart["curves"].append(_curve(run, one, name, number))
    return list(found.values())


def _curve(run: Run, one: Signal, name: str, number: int) -> dict[str, Any]:
    values = np.clip(one.values, -_LARGEST, _LARGEST)
    rows = decimated(values)
    if one.section == "Estimator":  # a sensor measures in some steps only
        rows = rows[np.isfinite(values[..., rows]).reshape(-1, len(rows)).all(axis=0)]
    return {
        "name": name,
        "role": one.role,
        "held": one.held,
        "run": number,
        "t": run.time_s[rows],
        "y": values[..., rows],
    }


def _drawable(limits: tuple[float, float] | None) -> list[float | None] | None:
    if limits is None or not np.isfinite(limits).any():
        return None
    return [value if np.isfinite(value) else None for value in limits]
