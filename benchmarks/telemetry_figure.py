# SPDX-License-Identifier: Apache-2.0
"""Runs of UTC side by side with the telemetry that shows how it is tuned."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.analysis.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PALE,
    PURPLE,
    VERMILLION,
    empty_figure,
    house_style,
    short,
)
from skydiver_utc.arrays import Array
from skydiver_utc.loop.run import Run

# Both hands have nearly the same: the dashes lie over the other line.
_SOLID: dict[str, Any] = {"linewidth": 0.9, "zorder": 2.0}
_DASHED: dict[str, Any] = {"linewidth": 0.9, "zorder": 3.0, "linestyle": (0, (4, 3))}
_DEVIATIONS = (
    ("std_Cm_damp_yaw", "damping", GREEN, _SOLID),
    ("std_k_right", "right hand", VERMILLION, _DASHED),
    ("std_k_left", "left hand", PURPLE, _SOLID),
    ("std_alpha", "α", BLUE, _SOLID),
)
# None of these is a control's.
_STATUS_COLOURS = {"solved": PALE, "saturated": ORANGE, "repaired": GREY, "kept_previous": INK}
_SMALLEST = 1e-6  # what the logarithmic axes still show


def telemetry_figure(title: str, runs: Mapping[str, Run]) -> Figure:
    """One column per run: yaw rate, innovation, standard deviations of U, repair of Pu, status."""
    with house_style():
        figure = empty_figure(9.0, 6.6)
        rows = figure.subplots(
            5, len(runs), sharex=True, sharey="row", squeeze=False,
            gridspec_kw={"height_ratios": [1.7, 1.2, 1.2, 0.9, 0.35], "hspace": 0.16, "wspace": 0.07},
        )  # fmt: skip
        for column, (label, run) in enumerate(runs.items()):
            _draw_column(rows[:, column], label, run)
        for axes, name in zip(
            rows[:, 0],
            ("yaw rate\n[deg/s]", "innovation\n[deg/s]", "std of U\n/ range [1]", "repair of\nPu", "status"),
            strict=True,
        ):
            axes.set_ylabel(name)
        reach = 1.5 * max(float(np.max(np.abs(np.rad2deg(run.reference[:, 0])))) for run in runs.values())
        rows[0, 0].set_ylim(-reach, reach)
        rows[1, 0].set_ylim(-0.5 * reach, 0.5 * reach)
        rows[2, 0].set_ylim(1e-4, 3.0)
        rows[3, 0].set_ylim(0.3 * _SMALLEST, 30.0)
        figure.text(0.01, 0.985, title, fontsize=12, fontweight="bold", va="top")
        _draw_legends(figure, rows[0, 0], rows[2, 0])
        figure.subplots_adjust(left=0.125, right=0.985, bottom=0.14, top=0.875)
        figure.align_ylabels(rows[:, 0])
    return figure


def _draw_column(axes: NDArray[np.object_], label: str, run: Run) -> None:
    rate, innovation, deviations, repair, status = axes
    time = run.time_s[:-1]
    found = metrics(run)
    head = "no RMSE" if found["rmse_deg_s"] is None else f"RMSE {short(found['rmse_deg_s'])} deg/s"
    ended = "" if found["outcome"] == "completed" else f", {found['outcome'].replace('_', ' ')}"
    rate.set_title(f"{label}\n{head}{ended}", fontsize=9.5)
    rate.plot(
        run.time_s,
        np.rad2deg(run.reference[:, 0]),
        color=ORANGE,
        linewidth=3.0,
        alpha=0.75,
        label="reference",
    )
    rate.plot(run.time_s, np.rad2deg(run.output("yaw_rate")), color=BLUE, linewidth=1.1, label="actual")
    innovation.plot(time, np.rad2deg(_named(run, "innovation_yaw_rate")), color=VERMILLION, linewidth=0.8)
    spans = run.plant.maximum - run.plant.minimum
    for (name, words, colour, line), span in zip(_DEVIATIONS, spans, strict=True):
        deviations.plot(time, _named(run, name) / span, color=colour, label=words, **line)
    deviations.set_yscale("log")
    lifted = np.maximum(_named(run, "repaired_covariance"), _SMALLEST)
    repair.plot(time, lifted, color=_STATUS_COLOURS["repaired"], linewidth=0.9)
    repair.set_yscale("log")
    _draw_status(status, run)
    status.set_xlabel("time [s]")


def _draw_status(axes: Axes, run: Run) -> None:
    end = float(run.time_s[-1])
    axes.imshow(
        run.status[np.newaxis], aspect="auto", interpolation="nearest", extent=(0.0, end, 0.0, 1.0),
        cmap=ListedColormap(list(_STATUS_COLOURS.values())), vmin=-0.5, vmax=len(_STATUS_COLOURS) - 0.5,
    )  # fmt: skip
    axes.set_yticks([])
    axes.grid(visible=False)
    axes.set_xlim(0.0, end)
    axes.xaxis.set_major_locator(MaxNLocator(4, prune="upper"))


def _draw_legends(figure: Figure, rate: Axes, deviations: Axes) -> None:
    figure.legend(
        *rate.get_legend_handles_labels(), loc="upper right", bbox_to_anchor=(1.0, 1.0), ncols=2, fontsize=8.5,
        columnspacing=1.0, handlelength=1.6,
    )  # fmt: skip
    figure.legend(
        *deviations.get_legend_handles_labels(), loc="lower left", bbox_to_anchor=(0.0, 0.0), ncols=4,
        title="std of", title_fontsize=8.5, fontsize=8.5, alignment="left", columnspacing=1.0, handlelength=1.2,
    )  # fmt: skip
    patches = [Patch(color=colour, label=name.replace("_", " ")) for name, colour in _STATUS_COLOURS.items()]
    figure.legend(
        handles=patches, loc="lower right", bbox_to_anchor=(1.0, 0.0), ncols=4, title="status", title_fontsize=8.5,
        fontsize=8.5, alignment="left", columnspacing=1.0, handlelength=1.2,
    )  # fmt: skip


def _named(run: Run, name: str) -> Array:
    return run.telemetry[:, run.telemetry_names.index(name)]
