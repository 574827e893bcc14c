"""The picture of one flight: what was asked for, what came of it, and what the controls did."""

import textwrap
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from skydiver_utc.analysis.labels import at_the_latest
from skydiver_utc.analysis.metrics import (
    CONVERGED_SHARE,
    SETTLING_S,
    angle_turned_deg,
    metrics,
    row_from,
    tracking_error_deg_s,
)
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
from skydiver_utc.parameters import ConstantReference, RotationReference, SineReference
from skydiver_utc.simulation.flight import Flight
from skydiver_utc.simulation.outcome import Outcome

CONTROLS = (
    ("yaw damping\n$C_{m,damp}$ [1]", GREEN),
    ("right hand\n$k_{right}$ [1]", VERMILLION),
    ("left hand\n$k_{left}$ [1]", PURPLE),
    ("pattern angle\n$\\alpha$ [rad]", BLUE),
)
# Label of the body rate that is drawn, by what the reference is for.
_PITCH_RATE = "pitch rate [deg/s]\nhead down positive"
_RATES = {"yaw_rate": "yaw rate [deg/s]\nleft turn positive", "pitch_rate": _PITCH_RATE, "alpha": _PITCH_RATE}


def tracking_figure(flight: Flight) -> Figure:
    """Tracked body rate, its error, the angle turned where one is asked for, and the four controls in their limits.

    8 by 10.4 inches; `png` makes it 1200 pixels wide.
    """
    with house_style():
        figure = empty_figure(8.0, 10.4)
        values = metrics(flight)
        panels: list[tuple[float, Callable[[Axes], None]]] = [(3.2, lambda axes: _draw_rate(axes, flight))]
        error = tracking_error_deg_s(flight)
        if error is not None:
            converged = values["convergence_time_s"]
            panels.append((1.6, lambda axes: _draw_error(axes, flight, error, converged)))
        if not isinstance(flight.scenario.reference, SineReference | ConstantReference):
            panels.append((1.6, lambda axes: _draw_angle(axes, flight)))
        controls = len(panels)
        panels += [(1.0, partial(_draw_control, flight=flight, j=j)) for j in range(len(CONTROLS))]
        heights = [height for height, _ in panels]
        rows = figure.subplots(
            len(panels), 1, sharex=True, gridspec_kw={"height_ratios": heights, "hspace": 0.19}
        )
        _draw_title(figure, flight, values)
        for axes, (_, draw) in zip(rows, panels, strict=True):
            draw(axes)
        rows[controls].legend(loc="lower right", bbox_to_anchor=(1.0, 0.96), ncols=2, borderaxespad=0.0)
        rows[-1].set_xlabel("time [s]")
        begin, end = float(flight.time_s[0]), float(flight.time_s[-1])
        rows[-1].set_xlim(begin, max(end, begin + flight.scenario.dt_s))
        for axes in rows:
            axes.yaxis.set_label_coords(-0.085, 0.5)
        figure.subplots_adjust(left=0.13, right=0.975, bottom=0.05, top=0.905)
    return figure


def _draw_title(figure: Figure, flight: Flight, values: dict[str, Any]) -> None:
    title = textwrap.shorten(flight.scenario.title, width=80, placeholder=" ...")
    figure.text(0.02, 0.985, title, fontsize=13, fontweight="bold", va="top")
    facts = [flight.outcome.value.replace("_", " ")]
    if values["rmse_deg_s"] is not None:
        facts.append(f"RMSE {short(values['rmse_deg_s'])} deg/s")
        facts.append(f"largest error {short(values['max_abs_error_deg_s'])} deg/s")
    if values["convergence_time_s"] is not None:
        in_doubt = at_the_latest(values, "convergence_time_s")
        facts.append(f"inside 5 % from {values['convergence_time_s']:.2f} s on{in_doubt}")
    fine = flight.outcome is Outcome.COMPLETED
    figure.text(0.02, 0.960, "   |   ".join(facts), va="top", color=GREY if fine else VERMILLION)
    lacks = f"recorded from {values['begins_at_s']:.2f} s on" if values["missing_steps"] else ""
    remarks = "; ".join(filter(None, (lacks, "" if fine else flight.reason)))
    shortened = textwrap.shorten(remarks, width=105, placeholder=" ...")
    figure.text(0.02, 0.941, shortened, va="top", fontsize=8.5, color=VERMILLION)


def _draw_rate(axes: Axes, flight: Flight) -> None:
    """The tracked rate over its reference; the pitch rate alone where the reference is for the pattern angle."""
    flown = np.rad2deg(flight.pitch_rate if flight.tracked is None else flight.tracked)
    shown, room = flown[np.isfinite(flown)], np.inf
    if flight.tracked is not None:
        asked = np.rad2deg(flight.reference)
        axes.plot(flight.time_s, asked, color=ORANGE, linewidth=4.5, alpha=0.75, label="reference")
        shown, room = np.append(shown, asked), _room(flight)
    axes.plot(flight.time_s, flown, color=BLUE, linewidth=1.3, label="flown")
    low, high = max(min(shown.min(), -1.0), -room), min(max(shown.max(), 1.0), room)
    axes.set_ylim(low - 0.06 * (high - low), high + 0.06 * (high - low))
    axes.set_ylabel(_RATES[flight.scenario.reference.signal])
    if flight.tracked is not None:
        _shade_settling(axes, flight)
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderaxespad=0.0)


def _draw_angle(axes: Axes, flight: Flight) -> None:
    """The angle turned, with the one asked for and how far the end is from it."""
    reference = flight.scenario.reference
    turned = angle_turned_deg(flight)
    if isinstance(reference, RotationReference) and flight.first_step == 0:
        wanted = reference.angle_deg
        axes.axhline(wanted, color=ORANGE, linewidth=4.5, alpha=0.75)
        axes.text(
            0.995, 0.5, f"ends {turned[-1] - wanted:+.1f} deg from the {wanted:g} deg asked for",
            transform=axes.transAxes, ha="right", va="center", fontsize=8.0, color=GREY, bbox=PLATE, zorder=5,
        )  # fmt: skip
    axes.plot(flight.time_s, turned, color=BLUE, linewidth=1.3)
    axes.set_ylabel(f"{'heading' if reference.signal == 'yaw_rate' else 'pitch'}\nturned [deg]")


def _draw_error(
    axes: Axes, flight: Flight, error: NDArray[np.float64], convergence_time_s: float | None
) -> None:
    band = CONVERGED_SHARE * flight.scenario.reference.amplitude_or_level_deg_s
    start = row_from(SETTLING_S, flight)
    settled = error[start:] if start < len(error) else error
    reach = max(1.15 * _largest(settled), 1.4 * band, 1e-3)
    reach = min(reach, _room(flight))
    if band > 0.0:
        axes.axhspan(-band, band, color=GREEN, alpha=0.14, linewidth=0.0)
        axes.text(
            0.995, 1.03, f"band: 5 % of the amplitude, {short(band)} deg/s", transform=axes.transAxes,
            ha="right", va="bottom", fontsize=8.0, color="#00694D",
        )  # fmt: skip
    axes.plot(flight.time_s, error, color=VERMILLION, linewidth=1.1)
    if convergence_time_s is not None and convergence_time_s > flight.time_s[0] + 0.5 * flight.scenario.dt_s:
        axes.axvline(convergence_time_s, color=GREEN, linewidth=1.2, linestyle=(0, (4, 2)))
    axes.set_ylim(-reach, reach)
    axes.set_ylabel("error\n[deg/s]")
    _shade_settling(axes, flight)
    if _largest(error) > reach:
        axes.text(
            0.995, 0.95, f"off the scale: up to {short(_largest(error))} deg/s", transform=axes.transAxes,
            ha="right", va="top", fontsize=8.0, color=GREY, bbox=PLATE, zorder=5,
        )  # fmt: skip


def _draw_control(axes: Axes, flight: Flight, j: int) -> None:
    label, colour = CONTROLS[j]
    time = flight.time_s[:-1]
    lower = flight.scenario.plant.limits.minimum[j]
    upper = flight.scenario.plant.limits.maximum[j]
    margin = 0.13 * (upper - lower)
    for inner, outer in ((lower, lower - margin), (upper, upper + margin)):
        axes.axhspan(inner, outer, color=PALE, linewidth=0.0)
        axes.axhline(inner, color=GREY, linewidth=0.8)
    axes.step(time, flight.commands[:, j], where="post", color="#999999", linewidth=0.8, label="asked for")
    axes.step(time, flight.applied[:, j], where="post", color=colour, linewidth=1.2, label="applied")
    axes.set_ylim(lower - margin, upper + margin)
    axes.set_yticks(sorted({lower, upper} | ({0.0} if lower < 0.0 < upper else set())))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_ylabel(label, fontsize=8.5)


def _shade_settling(axes: Axes, flight: Flight) -> None:
    """Grey out the seconds that RMSE and largest error leave out."""
    if flight.time_s[0] < SETTLING_S < flight.time_s[-1]:
        axes.axvspan(0.0, SETTLING_S, color=PALE, alpha=0.6, linewidth=0.0, zorder=0, label="not in the RMSE")


def _room(flight: Flight) -> float:
    """Half height of a yaw-rate axis [deg/s] that a tumbling body cannot press flat."""
    return 2.5 * max(_largest(np.rad2deg(flight.reference)), 40.0)


def _largest(values: NDArray[np.float64]) -> float:
    finite = values[np.isfinite(values)]
    return float(np.max(np.abs(finite))) if len(finite) else 0.0
