# SPDX-License-Identifier: Apache-2.0
"""The controls of a recorded run: under those that a check computed, or beside inputs that explain its motion."""

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from skydiver_utc.analysis.controller_check import Check
from skydiver_utc.analysis.figures import CONTROL_COLOURS
from skydiver_utc.analysis.inputs import Inputs, report
from skydiver_utc.analysis.style import GREY, PALE, empty_figure, house_style
from skydiver_utc.analysis.units import shown
from skydiver_utc.loop.run import Run


def check_figure(found: Check, controller: str) -> Figure:
    """The controls over time, recorded and computed; `controller` says which controller computed them."""
    run, time_s = found.run, found.run.time_s[:-1]

    def draw(axes: Axes, j: int, colour: str) -> None:
        recorded, computed = run.commands[:, j], found.commands[:, j]
        axes.step(time_s, recorded, where="post", color="#999999", linewidth=2.4, label="recorded")
        axes.step(time_s, computed, where="post", color=colour, linewidth=1.0, label="computed")

    return _figure(run, f"Commands of {controller}", f"at the recorded states of {run.scenario.name}", draw)


def inputs_figure(found: Inputs) -> Figure:
    """Each input over time: applied, estimated with two deviations, and pale where it is not seen."""
    run, values, time_s = found.run, report(found), found.time_s

    def draw(axes: Axes, j: int, colour: str) -> None:
        name = run.plant.control_names[j]
        low, high = float(run.plant.minimum[j]), float(run.plant.maximum[j])
        seen, applied = found.seen[:, j], run.applied[:, j]
        estimate, deviation = (np.where(seen, a[:, j], np.nan) for a in (found.estimate, found.deviation))
        least, most = (np.clip(estimate + sign * 2.0 * deviation, low, high) for sign in (-1.0, 1.0))
        axes.fill_between(
            time_s, low, high, where=~seen, color=PALE, linewidth=0.0, label="not seen", step="mid"
        )
        axes.step(run.time_s[:-1], applied, where="post", color="#BBBBBB", linewidth=0.7, label="applied")
        axes.plot(time_s, found.applied[:, j], color=GREY, linewidth=1.6, label="its mean over 0.25 s")
        axes.fill_between(time_s, least, most, color=colour, alpha=0.2, linewidth=0.0)
        axes.plot(time_s, estimate, color=colour, linewidth=1.1, label="estimated, 2 deviations")
        verdict, share = values["inputs"][name]["verdict"], 100 * values["inputs"][name]["seen_share"]
        axes.set_title(f"{verdict}, {share:.0f} % of the time", fontsize=8.5, loc="left")

    text = f"{run.scenario.title or run.scenario.name}, from {values['states']} states"
    return _figure(run, "Inputs that explain the measured motion", text, draw)


def _figure(run: Run, heading: str, text: str, draw: Callable[[Axes, int, str], None]) -> Figure:
    """One row for each control, drawn by its number and colour."""
    names = run.plant.control_names
    height = 1.3 + 1.55 * len(names)
    with house_style():
        figure = empty_figure(8.0, height)
        rows = figure.subplots(len(names), 1, sharex=True, squeeze=False, gridspec_kw={"hspace": 0.4})[:, 0]
        for j, (axes, name) in enumerate(zip(rows, names, strict=True)):
            draw(axes, j, CONTROL_COLOURS[j % len(CONTROL_COLOURS)])
            axes.set_ylabel(shown(run.plant, name, degrees=False).label, fontsize=8.5)
            axes.yaxis.set_label_coords(-0.085, 0.5)
        rows[0].legend(
            loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=4, borderaxespad=0.0, fontsize=8.0
        )
        rows[-1].set_xlabel("time [s]")
        rows[-1].set_xlim(float(run.time_s[0]), float(run.time_s[-1]))
        figure.text(0.02, 1.0 - 0.14 / height, heading, fontsize=13, fontweight="bold", va="top")
        figure.text(0.02, 1.0 - 0.42 / height, text, va="top", color=GREY)
        figure.subplots_adjust(left=0.13, right=0.975, bottom=0.5 / height, top=1.0 - 0.95 / height)
    return figure
