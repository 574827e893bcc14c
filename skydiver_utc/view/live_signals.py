# SPDX-License-Identifier: Apache-2.0
"""The signals of a flight as a page charts them: one row of numbers for each instant, and which chart shows which."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from skydiver_utc.analysis.units import shown
from skydiver_utc.arrays import Array
from skydiver_utc.plants.protocol import Plant


class Curve(NamedTuple):
    """A column of the rows as a line; output: which of the plant's, where the controller expects how it goes on."""

    label: str
    column: int
    output: int | None = None


class Chart(NamedTuple):
    """Curves of one unit over time."""

    title: str
    curves: tuple[Curve, ...]


class Instant(NamedTuple):
    """A flight at a time [s]: state (n,), what the actuators hold (a,), reference (l,), wind (3,) [m/s].

    deviations (m,) of the controls, NaN without; solve_time_s of the decision
    """

    time_s: float
    state: Array
    applied: Array
    reference: Array
    wind: Array
    deviations: Array
    solve_time_s: float


def deviations(plant: Plant, telemetry: Mapping[str, float]) -> Array:
    """Standard deviations (m,) of the controls among telemetry, by name; NaN without."""
    return np.array([telemetry.get(f"std_{name}", np.nan) for name in plant.control_names])


class Signals:
    """Rows (columns,) of time, outputs, reference, controls, their deviations, and solve time, as people read them.

    Controls with limits are in per cent of their range; telemetry: its names, with deviations to be charted or without.
    """

    def __init__(self, plant: Plant, tracked: tuple[str, ...], telemetry: Sequence[str]) -> None:
        self._plant, self._tracked = plant, tracked
        self._deviates = any(f"std_{name}" in telemetry for name in plant.control_names)
        L, l, m = len(plant.output_names), len(tracked), len(plant.control_names)
        self._at = np.cumsum([1, L, l, m, m, 1])
        self._outputs = np.array([shown(plant, name).factor for name in plant.output_names])
        self._reference = np.array([shown(plant, name).factor for name in tracked])
        span = plant.maximum - plant.minimum
        self._in_range = bool(np.isfinite(span).all() and (span > 0.0).all())
        self._origin = plant.minimum if self._in_range else np.zeros(m)
        self._span = 0.01 * span if self._in_range else np.ones(m)

    @property
    def count(self) -> int:
        """Columns of a row."""
        return int(self._at[-1])

    def row(self, now: Instant) -> Array:
        """The row (columns,) of an instant."""
        m = len(self._plant.control_names)
        row: Array = np.concatenate(
            [
                [now.time_s],
                self.outputs(now.state),
                self._reference * now.reference,
                (now.applied[:m] - self._origin) / self._span,
                now.deviations / self._span,
                [1e3 * now.solve_time_s],
            ]
        )
        row[~np.isfinite(row)] = 0.0  # a chart with anything else stays empty
        return row

    def outputs(self, states: Array) -> Array:
        """All outputs (..., L) of states (..., n), in the units shown."""
        return self._outputs * self._plant.outputs(states)

    def charts(self) -> tuple[Chart, ...]:
        """Tracked outputs with their reference, controls, their deviations, other outputs by unit, and solve time."""
        plant, (outputs, reference, controls, deviations, solve, _) = self._plant, map(int, self._at)
        of_output = {name: outputs + i for i, name in enumerate(plant.output_names)}
        found = [
            Chart(
                shown(plant, name).label,
                (
                    Curve("reference", reference + j),
                    Curve("actual", of_output[name], plant.output_names.index(name)),
                ),
            )
            for j, name in enumerate(self._tracked)
            if name in of_output
        ]
        unit = " [% of range]" if self._in_range else ""
        of_controls = [("controls", controls), ("standard deviation of controls", deviations)]
        for title, first in of_controls[: 1 + self._deviates]:
            names = enumerate(plant.control_names)
            curves = tuple(Curve(name.replace("_", " "), first + c) for c, name in names)
            found.append(Chart(title + unit, curves))
        others = [name for name in plant.output_names if name not in self._tracked]
        for unit in dict.fromkeys(shown(plant, name).unit for name in others):
            of_unit = [name for name in others if shown(plant, name).unit == unit]
            curves = tuple(Curve(shown(plant, name).name, of_output[name]) for name in of_unit)
            labels = [curve.label for curve in curves]
            found.append(Chart(f"{', '.join(labels) if len(labels) < 3 else 'outputs'} [{unit}]", curves))
        found.append(Chart("solve time [ms]", (Curve("solve time", solve),)))
        return tuple(found)
