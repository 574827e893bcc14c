# SPDX-License-Identifier: Apache-2.0
"""The picture of a check: recorded commands under the computed ones."""

from matplotlib.figure import Figure

from skydiver_utc.analysis.controller_check import Check
from skydiver_utc.analysis.figures import CONTROL_COLOURS
from skydiver_utc.analysis.style import GREY, empty_figure, house_style
from skydiver_utc.analysis.units import shown


def check_figure(found: Check, controller: str) -> Figure:
    """The controls over time, recorded and computed; `controller` says which controller computed them."""
    run, names = found.run, found.run.plant.control_names
    with house_style():
        figure = empty_figure(8.0, 1.6 + 1.2 * len(names))
        rows = figure.subplots(len(names), 1, sharex=True, squeeze=False, gridspec_kw={"hspace": 0.19})[:, 0]
        for j, (axes, name) in enumerate(zip(rows, names, strict=True)):
            colour = CONTROL_COLOURS[j % len(CONTROL_COLOURS)]
            time_s, recorded = run.time_s[:-1], run.commands[:, j]
            axes.step(time_s, recorded, where="post", color="#999999", linewidth=2.4, label="recorded")
            axes.step(
                time_s, found.commands[:, j], where="post", color=colour, linewidth=1.0, label="computed"
            )
            axes.set_ylabel(shown(run.plant, name, degrees=False).label, fontsize=8.5)
            axes.yaxis.set_label_coords(-0.085, 0.5)
        rows[0].legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=2, borderaxespad=0.0)
        rows[-1].set_xlabel("time [s]")
        rows[-1].set_xlim(float(run.time_s[0]), float(run.time_s[-1]))
        figure.text(0.02, 0.975, f"Commands of {controller}", fontsize=13, fontweight="bold", va="top")
        text = f"at the recorded states of {run.scenario.name}"
        figure.text(0.02, 0.935, text, va="top", color=GREY)
        figure.subplots_adjust(left=0.13, right=0.975, bottom=0.08, top=0.88)
    return figure
