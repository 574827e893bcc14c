# SPDX-License-Identifier: Apache-2.0
"""The picture of estimated inputs beside what was applied."""

import numpy as np
from matplotlib.figure import Figure

from skydiver_utc.analysis.figures import CONTROL_COLOURS
from skydiver_utc.analysis.inputs import Inputs, report
from skydiver_utc.analysis.style import GREY, PALE, empty_figure, house_style
from skydiver_utc.analysis.units import shown


def inputs_figure(found: Inputs) -> Figure:
    """Each input over time: applied, estimated with two deviations, and pale where it is not seen."""
    run, names, values = found.run, found.run.plant.control_names, report(found)
    height = 1.3 + 1.55 * len(names)
    with house_style():
        figure = empty_figure(8.0, height)
        rows = figure.subplots(len(names), 1, sharex=True, squeeze=False, gridspec_kw={"hspace": 0.4})[:, 0]
        for j, (axes, name) in enumerate(zip(rows, names, strict=True)):
            low, high = float(run.plant.minimum[j]), float(run.plant.maximum[j])
            seen, colour = found.seen[:, j], CONTROL_COLOURS[j % len(CONTROL_COLOURS)]
            estimate, deviation = (np.where(seen, a[:, j], np.nan) for a in (found.estimate, found.deviation))
            axes.fill_between(
                found.time_s, low, high, where=~seen, color=PALE, linewidth=0.0, label="not seen", step="mid"
            )
            axes.step(
                run.time_s[:-1],
                run.applied[:, j],
                where="post",
                color="#BBBBBB",
                linewidth=0.7,
                label="applied",
            )
            axes.plot(
                found.time_s, found.applied[:, j], color=GREY, linewidth=1.6, label="its mean over 0.25 s"
            )
            band = (
                np.clip(estimate - 2.0 * deviation, low, high),
                np.clip(estimate + 2.0 * deviation, low, high),
            )
            axes.fill_between(found.time_s, *band, color=colour, alpha=0.2, linewidth=0.0)
            axes.plot(found.time_s, estimate, color=colour, linewidth=1.1, label="estimated, 2 deviations")
            axes.set_ylabel(shown(run.plant, name, degrees=False).label, fontsize=8.5)
            of_input = values["inputs"][name]
            axes.set_title(
                f"{of_input['verdict']}, {100 * of_input['seen_share']:.0f} % of the time",
                fontsize=8.5,
                loc="left",
            )
            axes.yaxis.set_label_coords(-0.085, 0.5)
        rows[0].legend(
            loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=4, borderaxespad=0.0, fontsize=8.0
        )
        rows[-1].set_xlabel("time [s]")
        rows[-1].set_xlim(float(run.time_s[0]), float(run.time_s[-1]))
        heading = "Inputs that explain the measured motion"
        figure.text(0.02, 1.0 - 0.14 / height, heading, fontsize=13, fontweight="bold", va="top")
        text = f"{run.scenario.title or run.scenario.name}, from {values['states']} states"
        figure.text(0.02, 1.0 - 0.42 / height, text, va="top", color=GREY)
        figure.subplots_adjust(left=0.13, right=0.975, bottom=0.5 / height, top=1.0 - 0.95 / height)
    return figure
