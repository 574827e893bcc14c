# SPDX-License-Identifier: Apache-2.0
"""The charts of a flight in a viser page."""

from typing import TYPE_CHECKING, Any

import numpy as np

from skydiver_utc.analysis.style import BLUE, GREEN, ORANGE, PINK, SKY
from skydiver_utc.arrays import Array
from skydiver_utc.view.live_signals import Chart, Signals

if TYPE_CHECKING:  # it is imported only where a page is shown
    from viser import GuiApi

_COLOURS, _AHEAD, _AXIS = (ORANGE, BLUE, GREEN, PINK), SKY, "#888888"
_HEIGHT = 170  # pixels


class Ahead:
    """Outputs as a controller expects them: time (J,), and each output (S, J, L); row 0 under its command."""

    def __init__(self, time_s: Array, outputs: Array) -> None:
        self.time_s = time_s
        self.centre, self.low, self.high = outputs[0], np.fmin.reduce(outputs), np.fmax.reduce(outputs)


class Charts:
    """One uPlot chart for each `Chart` of a flight's signals; span [s]: of the time axis, None: as it comes."""

    def __init__(self, gui: "GuiApi", signals: Signals, span: tuple[float, float] | None = None) -> None:
        self._charts = signals.charts()
        self._handles = [self._add(gui, chart, span) for chart in self._charts]

    def show(self, rows: Array, ahead: Ahead | None = None) -> None:
        """Draw the rows (R, columns), and what is expected after them."""
        if len(rows) < 2:
            return
        for chart, handle in zip(self._charts, self._handles, strict=True):
            handle.data = _data(chart, rows, ahead)

    def _add(self, gui: "GuiApi", chart: Chart, span: tuple[float, float] | None) -> Any:
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


def _data(chart: Chart, rows: Array, ahead: Ahead | None) -> tuple[Array, ...]:
    """Time, then each curve, and the band of what is expected: over the rows, and beyond them.

    An output goes on as it is expected to, and the reference is known as far as the rows go: it stays.
    """
    output = next((curve.output for curve in chart.curves if curve.output is not None), None)
    if output is None:
        return rows[:, 0], *(rows[:, curve.column] for curve in chart.curves)
    actual = rows[:, next(curve.column for curve in chart.curves if curve.output == output)]
    if ahead is None:
        ahead = Ahead(rows[-1:, 0], np.full((1, 1, output + 1), actual[-1]))
    found = [np.append(rows[:, 0], ahead.time_s)]
    for curve in chart.curves:
        after = np.full(len(ahead.time_s), rows[-1, curve.column])
        found.append(
            np.append(rows[:, curve.column], after if curve.output is None else ahead.centre[:, output])
        )
    return (*found, *(np.append(actual, each[:, output]) for each in (ahead.high, ahead.low)))
