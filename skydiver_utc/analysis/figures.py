# SPDX-License-Identifier: Apache-2.0
"""The picture of one run: the wanted and the actual outputs, their error, and the controls."""

import itertools
import textwrap
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from skydiver_utc.analysis.labels import facts, missing
from skydiver_utc.analysis.metrics import CONVERGED_SHARE, metrics
from skydiver_utc.analysis.numbers import SETTLING_S, row_from
from skydiver_utc.analysis.skydiver import angle_turned_deg
from skydiver_utc.analysis.style import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PALE,
    PLATE,
    PURPLE,
    VERMILLION,
    empty_figure,
    house_style,
    short,
)
from skydiver_utc.analysis.units import disturbance_words, shown, shown_disturbance
from skydiver_utc.arrays import Array
from skydiver_utc.loop.outcome import Outcome
from skydiver_utc.loop.run import Run
from skydiver_utc.plants.skydiver.skydiver import SkydiverPlant
from skydiver_utc.references.profiles import Rotation
from skydiver_utc.references.tables import Points

if TYPE_CHECKING:  # it is imported only where a figure is drawn
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CONTROL_COLOURS = (GREEN, VERMILLION, PURPLE, BLUE)
_LEAST_RANGE, _LARGEST = 1e-6, 1e30  # of an axis, in its unit
Panel = tuple[float, Callable[["Axes"], None]]  # height, and how to draw it


@np.errstate(over="ignore", invalid="ignore")
def tracking_figure(run: Run) -> "Figure":
    """Each tracked output over its reference with its error, and the controls between their limits.

    Open loop: all outputs of the plant. A skydiver's rotation: the angle turned, too. `png` makes it 1200
    pixels wide.
    """
    with house_style():
        values, panels = metrics(run), _panels(run)
        controls = len(panels)
        panels += [(1.0, partial(_draw_control, run=run, j=j)) for j in range(len(run.plant.control_names))]
        heights = [height for height, _ in panels]
        figure = empty_figure(8.0, 1.6 + sum(heights))
        rows = figure.subplots(
            len(panels), 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": heights, "hspace": 0.19}
        )[:, 0]
        _draw_title(figure, run, values)
        for axes, (_, draw) in zip(rows, panels, strict=True):
            draw(axes)
            axes.yaxis.set_label_coords(-0.085, 0.5)
            for hole in values["holes_s"]:
                axes.axvspan(*hole, color=GREY, alpha=0.35, linewidth=1.0)
        rows[controls].legend(loc="lower right", bbox_to_anchor=(1.0, 0.96), ncols=2, borderaxespad=0.0)
        rows[-1].set_xlabel("time [s]")
        begin, end = float(run.time_s[0]), float(run.time_s[-1])
        rows[-1].set_xlim(begin, max(end, begin + run.scenario.dt_s))
        inches = figure.get_figheight()
        figure.subplots_adjust(left=0.13, right=0.975, bottom=0.52 / inches, top=1.0 - 0.99 / inches)
    return figure


def _panels(run: Run) -> list[Panel]:
    """The curves of each output."""
    found: list[Panel] = []
    if run.tracks_outputs:
        several = len(run.tracked_names) > 1
        for j in range(len(run.tracked_names)):
            found.append((2.0 if several else 3.2, partial(_draw_tracked, run=run, j=j)))
            found.append((1.2 if several else 1.6, partial(_draw_error, run=run, j=j)))
    else:
        found += [(1.6, partial(_draw_output, run=run, name=name)) for name in run.plant.output_names]
    by_unit: dict[str, list[str]] = {}
    for name in run.disturbance_names:
        if np.nan_to_num(run.disturbance[:, run.disturbance_names.index(name)]).any():
            by_unit.setdefault(_disturbance_label(run, name), []).append(name)
    found += [(1.2, partial(_draw_disturbance, run=run, names=names)) for names in by_unit.values()]
    if isinstance(run.plant, SkydiverPlant) and isinstance(run.scenario.reference, Rotation | Points):
        found.append((1.6, partial(_draw_angle, run=run)))
    return found


def _draw_title(figure: "Figure", run: Run, values: dict[str, Any]) -> None:
    inches = figure.get_figheight()
    title = textwrap.shorten(run.scenario.title or run.scenario.name, width=80, placeholder=" ...")
    figure.text(0.02, 1.0 - 0.16 / inches, title, fontsize=13, fontweight="bold", va="top")
    fine = run.outcome is Outcome.COMPLETED
    line = textwrap.shorten(
        "   |   ".join(facts(values)), width=150, placeholder=" ...", drop_whitespace=False
    )
    figure.text(0.02, 1.0 - 0.42 / inches, line, va="top", color=GREY if fine else VERMILLION)
    remarks = "; ".join(filter(None, (missing(values), "" if fine else run.reason)))
    shortened = textwrap.shorten(remarks, width=105, placeholder=" ...")
    figure.text(0.02, 1.0 - 0.61 / inches, shortened, va="top", fontsize=8.5, color=VERMILLION)


def _draw_output(axes: "Axes", run: Run, name: str) -> None:
    scale = shown(run.plant, name)
    axes.plot(run.time_s, _drawn(scale.factor * run.output(name)), color=BLUE, linewidth=1.3)
    low, high = axes.get_ylim()
    if high - low < _LEAST_RANGE:  # else an output that is zero shows its rounding
        axes.set_ylim(0.5 * (low + high - _LEAST_RANGE), 0.5 * (low + high + _LEAST_RANGE))
    axes.set_ylabel(scale.label.replace(" [", "\n["))


def _draw_tracked(axes: "Axes", run: Run, j: int) -> None:
    name = run.tracked_names[j]
    scale, most = shown(run.plant, name), reach(run, j)
    actual, wanted = (_drawn(scale.factor * each) for each in (run.output(name), run.reference[:, j]))
    axes.plot(run.time_s, wanted, color=ORANGE, linewidth=4.5, alpha=0.75, label="reference")
    axes.plot(run.time_s, actual, color=BLUE, linewidth=1.3, label="actual")
    values = np.append(actual[np.isfinite(actual)], wanted)
    # A run that diverges must not press the reference flat.
    low, high = max(float(values.min()), -most), min(float(values.max()), most)
    margin = 0.06 * (high - low) or 0.1 * (abs(high) or 1.0)
    axes.set_ylim(low - margin, high + margin)
    axes.set_ylabel(scale.label)
    _shade_settling(axes, run)
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderaxespad=0.0)


def _draw_error(axes: "Axes", run: Run, j: int) -> None:
    assert run.error is not None
    scale = shown(run.plant, run.tracked_names[j])
    error = _drawn(scale.factor * run.error[:, j])
    band = scale.factor * CONVERGED_SHARE * float(run.amplitude[j])
    start = row_from(SETTLING_S, run)
    settled = error[start:] if start < len(error) else error
    most = min(max(1.15 * _largest(settled), 1.4 * band, 1e-9), reach(run, j))
    if band > 0.0:
        axes.axhspan(-band, band, color=GREEN, alpha=0.14, linewidth=0.0)
        words = f"band: 5 % of the amplitude, {short(band)} {scale.unit}"
        _note(axes, 1.03, words, va="bottom", color="#00694D", bbox=None)
    axes.plot(run.time_s, error, color=VERMILLION, linewidth=1.1)
    axes.set_ylim(-most, most)
    axes.set_ylabel(f"error\n[{scale.unit}]")
    _shade_settling(axes, run)
    if _largest(error) > most:
        _note(axes, 0.95, f"off the scale: up to {short(_largest(error))} {scale.unit}", va="top")


def _draw_angle(axes: "Axes", run: Run) -> None:
    """The angle turned, with the wanted one and how far the end is from it."""
    reference, turned = run.scenario.reference, angle_turned_deg(run)
    if isinstance(reference, Rotation) and run.first_step == 0 and not run.holes:
        wanted = reference.angle_deg
        axes.axhline(wanted, color=ORANGE, linewidth=4.5, alpha=0.75)
        _note(axes, 0.5, f"ends {turned[-1] - wanted:+.1f} deg from the wanted {wanted:g} deg", va="center")
    axes.plot(run.time_s, turned, color=BLUE, linewidth=1.3)
    axes.set_ylabel(f"{'heading' if run.tracked_names == ('yaw_rate',) else 'pitch'}\nturned [deg]")


def _disturbance_label(run: Run, name: str) -> str:
    return f"{textwrap.fill(disturbance_words(name), 14)} [{shown_disturbance(run.plant, name).unit}]"


def _draw_disturbance(axes: "Axes", run: Run, names: list[str]) -> None:
    """Disturbances of one unit."""
    for name, colour in zip(names, itertools.cycle(CONTROL_COLOURS), strict=False):
        scale, column = shown_disturbance(run.plant, name), run.disturbance_names.index(name)
        values = _drawn(scale.factor * run.disturbance[:, column])
        axes.plot(run.time_s, values, color=colour, linewidth=0.9, label=scale.name)
    axes.set_ylabel(_disturbance_label(run, names[0]))
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.96), ncols=len(names), borderaxespad=0.0)


def _draw_control(axes: "Axes", run: Run, j: int) -> None:
    name, colour = run.plant.control_names[j], CONTROL_COLOURS[j % len(CONTROL_COLOURS)]
    lower, upper = float(run.plant.minimum[j]), float(run.plant.maximum[j])
    time_s, commands, applied = run.time_s[:-1], _drawn(run.commands[:, j]), _drawn(run.applied[:, j])
    axes.step(time_s, commands, where="post", color="#999999", linewidth=0.8, label="command")
    axes.step(time_s, applied, where="post", color=colour, linewidth=1.2, label="applied")
    if np.isfinite(upper - lower):
        margin = 0.13 * (upper - lower)
        for inner, outer in ((lower, lower - margin), (upper, upper + margin)):
            axes.axhspan(inner, outer, color=PALE, linewidth=0.0)
            axes.axhline(inner, color=GREY, linewidth=0.8)
        axes.set_ylim(lower - margin, upper + margin)
        axes.set_yticks(sorted({lower, upper} | ({0.0} if lower < 0.0 < upper else set())))
        axes.yaxis.set_major_formatter("{x:g}")
    axes.set_ylabel(shown(run.plant, name, degrees=False).label.replace(" [", "\n["), fontsize=8.5)


def _note(axes: "Axes", y: float, words: str, **style: Any) -> None:
    style = {"color": GREY, "bbox": PLATE, "zorder": 5, **style}
    axes.text(0.995, y, words, transform=axes.transAxes, ha="right", fontsize=8.0, **style)


def _shade_settling(axes: "Axes", run: Run) -> None:
    """Grey out the seconds that RMSE and largest error leave out."""
    if run.time_s[0] < SETTLING_S < run.time_s[-1]:
        axes.axvspan(0.0, SETTLING_S, color=PALE, alpha=0.6, linewidth=0.0, zorder=0, label="not in the RMSE")


def reach(run: Run, j: int) -> float:
    """Half height of an axis of a tracked output, in the unit shown, that a diverging run cannot press flat."""
    name = run.tracked_names[j]
    wanted, actual = _largest(run.reference[:, j]), _largest(run.output(name))
    # Around a reference of zero the actual values set the scale, as far as the run goes well.
    fair = wanted or (actual if run.outcome is not Outcome.DIVERGED else 1.0)
    return 2.5 * shown(run.plant, name).factor * (fair or 1.0)


def _drawn(values: Array) -> Array:
    """The values as far as an axis can be that far."""
    return np.clip(values, -_LARGEST, _LARGEST)


def _largest(values: Array) -> float:
    finite = values[np.isfinite(values)]
    return min(float(np.max(np.abs(finite))), _LARGEST) if len(finite) else 0.0
