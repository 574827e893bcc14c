# SPDX-License-Identifier: Apache-2.0
"""Pictures of many flights: sweeps of one parameter, and random tunings."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend_handler import HandlerTuple
from matplotlib.patches import Patch

from skydiver_utc.analysis.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PURPLE,
    VERMILLION,
    empty_figure,
    house_style,
)

_COLOURS = (BLUE, ORANGE)
_LINES: tuple[Any, ...] = ("-", (0, (4, 1.5)))
_CASES = (
    *((BLUE, "o"), (PURPLE, "s"), (GREY, "^"), (GREEN, "v"), (VERMILLION, "D"), (ORANGE, "x"), (INK, "+")),
    *((BLUE, "x"), (PURPLE, "+")),
)
_PANELS_IN_ROW = 3


class Cloud(NamedTuple):
    """Random tunings: their colour and line, RMSE [deg/s] (inf without one), each factor's rank correlation."""

    label: str
    colour: int
    line: int
    rmse: Sequence[float]
    rank_correlation: Mapping[str, float]


def tuning_figure(clouds: Sequence[Cloud], bar_deg_s: float) -> Figure:
    """Share of tunings below an RMSE, and the factors that move the RMSE."""
    with house_style():
        figure = empty_figure(10.0, 5.4)
        shares, bars = figure.subplots(1, 2, gridspec_kw={"width_ratios": [1.15, 1.0]})
        handles: list[Any] = []  # a tuple of artists is one entry
        for cloud in clouds:
            sizes = np.sort(np.array(cloud.rmse))
            share = np.arange(1, len(sizes) + 1) / len(sizes)
            (line,) = shares.step(
                sizes, 100.0 * share, where="post", color=_COLOURS[cloud.colour % 2],
                linestyle=_LINES[cloud.line % 2], linewidth=1.6,
            )  # fmt: skip
            handles.append((line, Patch(color=_COLOURS[cloud.colour % 2], alpha=_strength(cloud))))
        shares.axvline(bar_deg_s, color=GREY, linewidth=1.0, linestyle=(0, (4, 2)))
        shares.annotate(
            "5 % of the amplitude", (bar_deg_s, 3.0), xytext=(5, 0), textcoords="offset points", color=GREY,
            fontsize=8.5,
        )  # fmt: skip
        shares.set_xscale("log")
        shares.set_ylim(0.0, 103.0)
        shares.set_xlabel("RMSE from 2 s on [deg/s]")
        shares.set_ylabel("random tunings with at most this RMSE [%]")
        _draw_correlations(bars, clouds)
        figure.legend(
            handles, [cloud.label for cloud in clouds], loc="upper left", ncols=2, handlelength=4.0,
            handler_map={tuple: HandlerTuple(ndivide=None)},
        )  # fmt: skip
        figure.subplots_adjust(left=0.07, right=0.985, bottom=0.1, top=0.87, wspace=0.5)
    return figure


def _strength(cloud: Cloud) -> float:
    """Opacity of a cloud's bars: light where its line is dashed."""
    return 0.5 if cloud.line % 2 else 1.0


def _draw_correlations(axes: Axes, clouds: Sequence[Cloud]) -> None:
    names = list(clouds[0].rank_correlation)
    places = np.arange(len(names))
    height = 0.8 / len(clouds)
    for i, cloud in enumerate(clouds):
        values = [cloud.rank_correlation[name] for name in names]
        axes.barh(
            places + (i + 0.5) * height - 0.4, values, height=height, color=_COLOURS[cloud.colour % 2],
            alpha=_strength(cloud),
        )  # fmt: skip
    axes.axvline(0.0, color=GREY, linewidth=0.8)
    axes.set_yticks(places, names)
    axes.invert_yaxis()
    axes.set_xlim(-1.0, 1.0)
    axes.set_xticks((-1.0, -0.5, 0.0, 0.5, 1.0))
    axes.set_xlabel("rank correlation of the factor with the RMSE")
    axes.grid(visible=False, axis="y")


class ErrorMap(NamedTuple):
    """A metric of runs against one value that varies: by case the values, rising, and the metric of each."""

    label: str
    logarithmic: bool
    cases: Mapping[str, tuple[Sequence[float], Sequence[float]]]


def error_maps(panels: Sequence[ErrorMap], metric: str, bars: Sequence[float], connected: bool) -> Figure:
    """A metric against each value, one panel a value, one colour a case, with the bars of a success."""
    columns = min(len(panels), _PANELS_IN_ROW)
    rows = -(-len(panels) // columns)
    cases = list(dict.fromkeys(case for panel in panels for case in panel.cases))
    height = 2.5 * rows + 0.9
    with house_style():
        figure = empty_figure(max(3.2 * columns, 6.4), height)
        axes = figure.subplots(rows, columns, sharey=True, squeeze=False).ravel()
        for at, panel in zip(axes, panels, strict=False):
            for case, (values, measured) in panel.cases.items():
                colour, marker = _CASES[cases.index(case) % len(_CASES)]
                at.plot(
                    values, measured, color=colour, marker=marker, markersize=3.5, linewidth=1.0,
                    linestyle="-" if connected else "none", label=case,
                )  # fmt: skip
            for bar in bars:
                at.axhline(bar, color=GREY, linewidth=1.0, linestyle=(0, (4, 2)))
            at.set_xlabel(panel.label, parse_math=False)
            at.set_yscale("log")
            at.set_xscale("log" if panel.logarithmic else "linear")
        for at in axes[len(panels) :]:
            at.set_visible(False)
        for at in axes[::columns]:
            at.set_ylabel(metric)
        lines = {
            label: line for at in axes for line, label in zip(*at.get_legend_handles_labels(), strict=True)
        }
        figure.legend([lines[case] for case in cases], cases, loc="upper center", ncols=min(len(cases), 4))
        figure.subplots_adjust(
            left=0.09, right=0.985, bottom=0.5 / height, top=1.0 - 0.75 / height, wspace=0.08, hspace=0.35
        )
    return figure
