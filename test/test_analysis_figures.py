"""The figure of a flight: what it shows, and that it can be drawn for every flight."""

from io import BytesIO
from typing import Any

import matplotlib
import msgspec
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread
from test_analysis_metrics import flight_of, scenario_of

from skydiver_utc.analysis.figures import tracking_figure
from skydiver_utc.analysis.style import png
from skydiver_utc.parameters import RotationReference
from skydiver_utc.simulation.flight import Flight
from skydiver_utc.simulation.outcome import Outcome


def texts(figure: Figure) -> str:
    """Everything that is written in a figure, but for the axes' numbers."""
    axes = figure.axes
    found: list[Any] = [*figure.texts, *(t for a in axes for t in a.texts), *(a.yaxis.label for a in axes)]
    found += [t for a in axes if (legend := a.get_legend()) for t in legend.get_texts()]
    return "\n".join(t.get_text() for t in [*found, axes[-1].xaxis.label])


def line(figure: Figure, row: int, label: str) -> Any:
    return next(one for one in figure.axes[row].lines if one.get_label() == label)


def test_it_says_what_it_shows() -> None:
    written = texts(tracking_figure(flight_of(103.0)))
    for part in ("Synthetic flight", "completed", "RMSE 3.00 deg/s", "inside 5 % from 0.00 s on"):
        assert part in written
    for part in ("yaw rate [deg/s]", "error\n[deg/s]", "[rad]", "time [s]", "reference", "flown", "applied"):
        assert part in written


def test_the_lines_are_the_flight() -> None:
    rates = np.linspace(0.0, 100.0, 81)
    figure = tracking_figure(flight_of(rates, applied=np.tile([1.0, 0.2, 0.3, 0.4], (80, 1))))
    assert np.allclose(line(figure, 0, "flown").get_ydata(), rates)
    assert np.allclose(line(figure, 0, "reference").get_ydata(), 100.0)
    assert np.allclose(line(figure, 0, "flown").get_xdata(), np.arange(81) * 0.05)
    assert [line(figure, row, "applied").get_ydata()[0] for row in range(2, 6)] == [1.0, 0.2, 0.3, 0.4]


def test_the_limits_are_on_the_axes_of_the_controls() -> None:
    figure = tracking_figure(flight_of())
    assert list(figure.axes[2].get_yticks()) == [0.0, 4.0]
    assert list(figure.axes[5].get_yticks()) == [-1.0, 0.0, 1.0]


def test_an_unhappy_ending_gives_its_reason() -> None:
    flight = flight_of(outcome=Outcome.ROLLED_OVER, reason="the dorsal axis went below the horizon at 2 s")
    assert "rolled over" in texts(tracking_figure(flight))
    assert flight.reason in texts(tracking_figure(flight))


def test_a_tumbling_body_does_not_press_the_reference_flat() -> None:
    rates = np.full(81, 100.0)
    rates[60:] = 1e4
    figure = tracking_figure(flight_of(rates, outcome=Outcome.DIVERGED))
    assert figure.axes[0].get_ylim()[1] < 300.0
    assert "off the scale: up to 9900 deg/s" in texts(figure)


def test_a_recording_that_lacks_the_beginning_says_so_and_starts_where_it_does() -> None:
    rotation = RotationReference(angle_deg=180.0, start_s=1.0, duration_s=2.0)
    whole = flight_of(100.0, 90.0, msgspec.structs.replace(scenario_of(), reference=rotation))
    figure = tracking_figure(whole.since(30))
    assert "recorded from 1.50 s on" in texts(figure)
    assert "deg asked for" in texts(tracking_figure(whole))
    assert "deg asked for" not in texts(figure)
    assert figure.axes[-1].get_xlim() == pytest.approx((1.5, 4.0))
    assert np.allclose(line(figure, 0, "flown").get_xdata(), 0.05 * np.arange(30, 81))


@pytest.mark.parametrize(
    "flight",
    [
        pytest.param(flight_of(steps=0, outcome=Outcome.NO_COMMAND), id="no step"),
        pytest.param(flight_of(steps=3, outcome=Outcome.ABORTED), id="three steps"),
        pytest.param(flight_of(np.full(81, np.nan), outcome=Outcome.DIVERGED), id="not a number"),
        pytest.param(
            flight_of(0.0, 0.0, scenario_of(kind="constant", yaw_rate_deg_s=0.0)), id="straight fall"
        ),
    ],
)
def test_every_flight_can_be_drawn(flight: Flight) -> None:
    assert imread(BytesIO(png(tracking_figure(flight)))).shape[1] == 1200


def test_equal_flights_give_equal_files_whatever_the_user_has_set() -> None:
    plain = png(tracking_figure(flight_of()))
    with matplotlib.rc_context({"font.size": 30, "savefig.dpi": 10, "axes.grid": False}):
        assert png(tracking_figure(flight_of())) == plain
        assert matplotlib.rcParams["font.size"] == 30
