# SPDX-License-Identifier: Apache-2.0
"""The picture that shows whether an estimate can be believed."""

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from skydiver_utc.analysis.estimation import consistencies, estimation_errors, innovations
from skydiver_utc.analysis.style import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    VERMILLION,
    empty_figure,
    house_style,
)
from skydiver_utc.analysis.units import in_degrees
from skydiver_utc.arrays import Array
from skydiver_utc.estimators.consistency import Consistency, correlation
from skydiver_utc.loop.run import Run

if TYPE_CHECKING:  # it is imported only where a figure is drawn
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLOURS = (BLUE, ORANGE, PURPLE, VERMILLION)
_LAGS = 20
_WINDOW = 48  # measurements in a moving mean
_ACROSS = 3
_HEADING: Any = {"fontsize": 13, "fontweight": "bold", "va": "top"}


def validation_figure(run: Run) -> "Figure":
    """For each sensor its NIS and the correlation of its innovations; for each state the error and its deviation."""
    found, errors = consistencies(run), estimation_errors(run)
    below = -(-len(errors) // _ACROSS)
    height = 1.3 + 1.9 * len(found) + 1.35 * below
    with house_style():
        figure = empty_figure(9.0, height)
        grid = figure.add_gridspec(
            len(found) + below, 6, height_ratios=[1.9] * len(found) + [1.35] * below, hspace=0.75, wspace=1.0,
            left=0.07, right=0.985, bottom=0.5 / height, top=1.0 - 1.1 / height,
        )  # fmt: skip
        for row, (name, sensor) in enumerate(found.items()):
            normalised = innovations(run, name)
            _draw_nis(figure.add_subplot(grid[row, :4]), run, name, sensor, normalised)
            _draw_correlation(figure.add_subplot(grid[row, 4:]), sensor, normalised)
        for j, (name, (error, deviation)) in enumerate(errors.items()):
            row, column = divmod(j, _ACROSS)
            axes = figure.add_subplot(grid[len(found) + row, 2 * column : 2 * column + 2])
            _draw_error(axes, run, name, error, deviation)
            if j >= len(errors) - _ACROSS:
                axes.set_xlabel("time [s]")
        figure.text(0.02, 1.0 - 0.14 / height, "Can the estimate be believed?", **_HEADING)
        verdicts = (f"{name.replace('_', ' ')} {sensor.verdict}" for name, sensor in found.items())
        facts = f"{run.scenario.title or run.scenario.name}   |   {', '.join(verdicts)}"
        shortened = textwrap.shorten(facts, width=120, placeholder=" ...")
        figure.text(0.02, 1.0 - 0.42 / height, shortened, va="top", color=GREY)
    return figure


def _draw_nis(axes: "Axes", run: Run, name: str, sensor: Consistency, normalised: Array) -> None:
    measured = np.isfinite(normalised).all(axis=1)
    nis, time_s = np.sum(np.square(normalised[measured]), axis=1), run.time_s[:-1][measured]
    axes.plot(time_s, nis, ".", color="#BBBBBB", markersize=2.0)
    if len(nis) >= _WINDOW:
        mean = np.convolve(nis, np.full(_WINDOW, 1.0 / _WINDOW), mode="valid")
        axes.plot(time_s[_WINDOW - 1 :], mean, color=BLUE, linewidth=1.3)
        spread = 1.96 * np.sqrt(2.0 * sensor.size / _WINDOW)
        axes.axhspan(sensor.size - spread, sensor.size + spread, color=GREEN, alpha=0.18, linewidth=0.0)
        axes.set_ylim(0.0, max(3.0 * sensor.size, 1.1 * float(mean.max())))
    expected = f"{sensor.low:.3g} to {sensor.high:.3g} expected" if sensor.measurements else "no measurement"
    axes.set_title(
        f"{name.replace('_', ' ')}: innovation squared (NIS), mean {sensor.mean:.3g}, {expected}\n"
        f"line: mean of {_WINDOW}; 95 % of a right filter's lie in the band",
        fontsize=8.5, loc="left",
    )  # fmt: skip


def _draw_correlation(axes: "Axes", sensor: Consistency, normalised: Array) -> None:
    found = normalised[np.isfinite(normalised).all(axis=1)]
    lags = np.arange(1, min(_LAGS, len(found) - 1) + 1)
    axes.axhspan(-sensor.bound, sensor.bound, color=GREEN, alpha=0.18, linewidth=0.0)
    if len(lags):
        values = np.array([correlation(found, int(lag)) for lag in lags])
        for k in range(values.shape[1]):
            axes.plot(
                lags, values[:, k], ".-", color=_COLOURS[k % len(_COLOURS)], linewidth=0.7, markersize=3.0
            )
    axes.set_title("correlation with the innovation\nso many measurements later", fontsize=8.5, loc="left")


def _draw_error(axes: "Axes", run: Run, name: str, error: Array, deviation: Array) -> None:
    unit, factor = in_degrees("rad" if name.startswith("attitude_") else run.plant.units.get(name, "1"))
    time_s, error, deviation = run.time_s[:-1], factor * error, factor * deviation
    axes.fill_between(time_s, -2.0 * deviation, 2.0 * deviation, color=GREEN, alpha=0.18, linewidth=0.0)
    axes.plot(time_s, error, color=VERMILLION, linewidth=0.9)
    # The start, where little is known, must not press the rest flat.
    late = slice(len(error) // 10, None)
    reach = 1.3 * max(np.nanmax(np.abs(error[late])), 2.0 * np.nanmax(deviation[late]), 1e-9)
    axes.set_ylim(-reach, reach)
    inside = 100.0 * float(np.mean(np.abs(error) <= 2.0 * deviation))
    axes.set_title(
        f"{name.replace('_', ' ')} error [{unit}]\n{inside:.0f} % inside 2 deviations",
        fontsize=8.5,
        loc="left",
    )
