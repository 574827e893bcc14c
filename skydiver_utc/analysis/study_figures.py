# SPDX-License-Identifier: Apache-2.0
"""Pictures of many flights: a metric against values that vary."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from matplotlib.figure import Figure

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

_CASES = (
    *((BLUE, "o"), (PURPLE, "s"), (GREY, "^"), (GREEN, "v"), (VERMILLION, "D"), (ORANGE, "x"), (INK, "+")),
    *((BLUE, "x"), (PURPLE, "+")),
)
_PANELS_IN_ROW = 3


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
