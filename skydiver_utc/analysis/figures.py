"""The picture of one flight: what was asked for, what came of it, and what the controls did."""

import textwrap
from io import BytesIO
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from skydiver_utc.analysis.metrics import CONVERGED_SHARE, SETTLING_S, first_step_from, metrics
from skydiver_utc.simulation.flight import Flight
from skydiver_utc.simulation.outcome import Outcome

# Okabe and Ito's palette: told apart with every common colour vision.
BLUE, ORANGE, VERMILLION, GREEN, PURPLE = "#0072B2", "#E69F00", "#D55E00", "#009E73", "#AA4499"
INK, GREY, PALE = "#222222", "#777777", "#EDEDED"

_CONTROLS = (
    ("yaw damping\n$C_{m,damp}$ [1]", GREEN),
    ("right hand\n$k_{right}$ [1]", VERMILLION),
    ("left hand\n$k_{left}$ [1]", PURPLE),
    ("pattern angle\n$\\alpha$ [rad]", BLUE),
)
_STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.5,
    "axes.labelsize": 9.5,
    "axes.edgecolor": GREY,
    "axes.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.grid": True,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.6,
    "text.color": INK,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "lines.solid_capstyle": "round",
    "legend.frameon": False,
    "legend.fontsize": 9.0,
}


def tracking_figure(flight: Flight) -> Figure:
    """Yaw rate against its reference, the error, and the four controls inside their limits.

    8 by 10.4 inches; `png` makes it 1200 pixels wide.
    """
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_STYLE)
        figure = Figure(figsize=(8.0, 10.4))
        FigureCanvasAgg(figure)
        rows = figure.subplots(
            6, 1, sharex=True, gridspec_kw={"height_ratios": [3.2, 1.6, 1, 1, 1, 1], "hspace": 0.19}
        )
        values = metrics(flight)
        _draw_title(figure, flight, values)
        _draw_yaw_rate(rows[0], flight)
        _draw_error(rows[1], flight, values["convergence_time_s"])
        for j, axes in enumerate(rows[2:]):
            _draw_control(axes, flight, j)
        rows[2].legend(loc="lower right", bbox_to_anchor=(1.0, 0.96), ncols=2, borderaxespad=0.0)
        rows[-1].set_xlabel("time [s]")
        rows[-1].set_xlim(0.0, max(float(flight.time_s[-1]), flight.scenario.dt_s))
        for axes in rows:
            axes.yaxis.set_label_coords(-0.085, 0.5)
        figure.subplots_adjust(left=0.13, right=0.975, bottom=0.05, top=0.905)
    return figure


def png(figure: Figure) -> bytes:
    """A PNG 1200 pixels wide whose bytes depend on the flight and matplotlib's version only."""
    buffer = BytesIO()
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        figure.savefig(buffer, format="png", dpi=150, metadata={"Software": None})
    return buffer.getvalue()


def _draw_title(figure: Figure, flight: Flight, values: dict[str, Any]) -> None:
    title = textwrap.shorten(flight.scenario.title, width=80, placeholder=" ...")
    figure.text(0.02, 0.985, title, fontsize=13, fontweight="bold", va="top")
    facts = [flight.outcome.value.replace("_", " ")]
    if values["rmse_deg_s"] is not None:
        facts.append(f"RMSE {short(values['rmse_deg_s'])} deg/s")
        facts.append(f"largest error {short(values['max_abs_error_deg_s'])} deg/s")
    if values["convergence_time_s"] is not None:
        facts.append(f"inside 5 % from {values['convergence_time_s']:.2f} s on")
    fine = flight.outcome is Outcome.COMPLETED
    figure.text(0.02, 0.960, "   |   ".join(facts), va="top", color=GREY if fine else VERMILLION)
    if not fine:
        reason = textwrap.shorten(flight.reason, width=105, placeholder=" ...")
        figure.text(0.02, 0.941, reason, va="top", fontsize=8.5, color=VERMILLION)


def _draw_yaw_rate(axes: Axes, flight: Flight) -> None:
    asked, flown = np.rad2deg(flight.reference), np.rad2deg(flight.yaw_rate)
    axes.plot(flight.time_s, asked, color=ORANGE, linewidth=4.5, alpha=0.75, label="reference")
    axes.plot(flight.time_s, flown, color=BLUE, linewidth=1.3, label="flown")
    reach = min(max(_largest(asked), _largest(flown), 1.0), _room(flight))
    axes.set_ylim(-1.12 * reach, 1.12 * reach)
    axes.set_ylabel("yaw rate [deg/s]\nleft turn positive")
    _shade_settling(axes, flight)
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderaxespad=0.0)


def _draw_error(axes: Axes, flight: Flight, convergence_time_s: float | None) -> None:
    error = np.rad2deg(flight.yaw_rate - flight.reference)
    band = CONVERGED_SHARE * flight.scenario.reference.amplitude_or_level_deg_s
    start = first_step_from(SETTLING_S, flight.scenario)
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
    if convergence_time_s is not None and convergence_time_s > 0.0:
        axes.axvline(convergence_time_s, color=GREEN, linewidth=1.2, linestyle=(0, (4, 2)))
    axes.set_ylim(-reach, reach)
    axes.set_ylabel("error\n[deg/s]")
    _shade_settling(axes, flight)
    if _largest(error) > reach:
        axes.text(
            0.995, 0.95, f"off the scale: up to {short(_largest(error))} deg/s", transform=axes.transAxes,
            ha="right", va="top", fontsize=8.0, color=GREY, bbox=_PLATE, zorder=5,
        )  # fmt: skip


def _draw_control(axes: Axes, flight: Flight, j: int) -> None:
    label, colour = _CONTROLS[j]
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
    if flight.time_s[-1] > SETTLING_S:
        axes.axvspan(0.0, SETTLING_S, color=PALE, alpha=0.6, linewidth=0.0, zorder=0, label="not in the RMSE")


def _room(flight: Flight) -> float:
    """Half height of a yaw-rate axis [deg/s] that a tumbling body cannot press flat."""
    return 2.5 * max(_largest(np.rad2deg(flight.reference)), 40.0)


def short(value: float) -> str:
    """Three digits or so of a value that is not negative."""
    return f"{value:.2f}" if value < 10.0 else f"{value:.1f}" if value < 100.0 else f"{value:.0f}"


def _largest(values: NDArray[np.float64]) -> float:
    finite = values[np.isfinite(values)]
    return float(np.max(np.abs(finite))) if len(finite) else 0.0


_PLATE = {"facecolor": "white", "edgecolor": "none", "alpha": 0.9, "pad": 1.5}
