# SPDX-License-Identifier: Apache-2.0
"""The signals of a flight, one row of numbers for each instant, and their charts in a viser page."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from skydiver_utc.analysis.style import BLUE, GREEN, ORANGE, PINK, SKY
from skydiver_utc.analysis.units import shown
from skydiver_utc.arrays import Array
from skydiver_utc.plants.protocol import Plant

if TYPE_CHECKING:  # it is imported only where a page is shown
    from viser import GuiApi

_COLOURS, _AHEAD, _AXIS = (ORANGE, BLUE, GREEN, PINK), SKY, "#888888"
_HEIGHT = 170  # pixels


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

    telemetry: of the decision, by name; its `solve_time` [s] among it
    """

    time_s: float
    state: Array
    applied: Array
    reference: Array
    wind: Array
    telemetry: Mapping[str, float]


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
                self.deviations(now) / self._span,
                [1e3 * now.telemetry.get("solve_time", np.nan)],
            ]
        )
        row[~np.isfinite(row)] = 0.0  # a chart with anything else stays empty
        return row

    def deviations(self, now: Instant) -> Array:
        """Standard deviations (m,) of the controls; NaN without."""
        return np.array([now.telemetry.get(f"std_{name}", np.nan) for name in self._plant.control_names])

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


def add_chart(gui: "GuiApi", chart: Chart, span: tuple[float, float] | None) -> Any:
    """An uPlot chart, and viser's handle of it; span [s]: of the time axis, None: as it comes."""
    series: list[Any] = [{"label": "time [s]"}]
    for i, curve in enumerate(chart.curves):
        series.append({"label": curve.label, "stroke": _COLOURS[i % len(_COLOURS)], "width": 2.0})
    expects = [i for i, curve in enumerate(chart.curves, 1) if curve.output is not None]
    edge = {"stroke": _AHEAD, "width": 1.0}
    series += [{"label": f"expected, {end}", **edge} for _ in expects for end in ("most", "least")]
    first = 1 + len(chart.curves)
    bands = [{"series": (first, first + 1), "fill": f"{_AHEAD}55"}] if expects else None
    faint = {"stroke": f"{_AXIS}44", "width": 1.0}
    axis = {"stroke": _AXIS, "grid": faint, "ticks": faint}
    scale = {"time": False} | ({} if span is None else {"auto": False, "range": span})
    return gui.add_uplot(
        tuple(np.zeros(2) for _ in series),
        tuple(series),
        title=chart.title,
        bands=bands and tuple(bands),  # type: ignore[arg-type]
        scales={"x": scale},  # type: ignore[dict-item]
        axes=(axis, axis | {"size": 52}),  # type: ignore[arg-type]
        legend={"show": len(chart.curves) > 1, "live": False},
        height=_HEIGHT,
    )


def chart_data(chart: Chart, rows: Array, time_s: Array, expected: Array) -> tuple[Array, ...]:
    """Time, then each curve, and the band of what is expected: over the rows, and beyond them at time_s (J,).

    An output goes on as it is expected to, (S, J, L), row 0 under the controller's command, and stays where nothing is
    expected, S = 0; the reference is known as far as the rows go: it stays.
    """
    output = next((curve.output for curve in chart.curves if curve.output is not None), None)
    if output is None:
        return rows[:, 0], *(rows[:, curve.column] for curve in chart.curves)
    actual = rows[:, next(curve.column for curve in chart.curves if curve.output == output)]
    values = expected[:, :, output] if len(expected) else actual[-1:, np.newaxis]
    found = [np.append(rows[:, 0], time_s)]
    for curve in chart.curves:
        after = np.full(len(time_s), rows[-1, curve.column]) if curve.output is None else values[0]
        found.append(np.append(rows[:, curve.column], after))
    return (*found, *(np.append(actual, edge.reduce(values)) for edge in (np.fmax, np.fmin)))
