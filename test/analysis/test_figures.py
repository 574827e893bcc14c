# SPDX-License-Identifier: Apache-2.0
"""The figure of a run, and that it can be made of every run."""

from io import BytesIO
from typing import Any

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread
from runs import cart, odd_runs, rotation, run_of, skydiver

from skydiver_utc.analysis.figures import tracking_figure
from skydiver_utc.analysis.style import png
from skydiver_utc.loop.outcome import Outcome


def texts(figure: Figure) -> str:
    """Everything that is written in a figure, but for the axes' numbers."""
    axes = figure.axes
    found: list[Any] = [*figure.texts, *(t for a in axes for t in a.texts), *(a.yaxis.label for a in axes)]
    found += [t for a in axes if (legend := a.get_legend()) for t in legend.get_texts()]
    return "\n".join(t.get_text() for t in [*found, axes[-1].xaxis.label])


def line(figure: Figure, row: int, label: str) -> Any:
    return next(one for one in figure.axes[row].lines if one.get_label() == label)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        (
            {"yaw_rate_deg_s": 103.0},
            "Synthetic run|completed|RMSE 3.00 deg/s|yaw rate [deg/s]|alpha\n[rad]|time [s]",
        ),
        ({"scenario": cart()}, "A cart on rails|place [1]|speed [1]|force\n[1]"),
        ({"outcome": Outcome.ROLLED_OVER, "reason": "below the horizon at 2 s"}, "below the horizon at 2 s"),
    ],
)
def test_a_plant_has_its_names_and_units_and_a_run_its_mishap(fields: dict[str, Any], words: str) -> None:
    """Value and error of each output, and each control, have a panel."""
    run = run_of(**fields)
    figure = tracking_figure(run)
    assert [word for word in words.split("|") if word not in texts(figure)] == []
    assert len(figure.axes) == 2 * len(run.tracked_names) + len(run.plant.control_names)


def test_the_lines_are_those_of_the_run() -> None:
    rates = np.linspace(0.0, 100.0, 81)
    figure = tracking_figure(run_of(rates, applied=np.tile([1.0, 0.2, 0.3, 0.4], (80, 1))))
    assert np.allclose(line(figure, 0, "actual").get_ydata(), rates)
    assert np.allclose(line(figure, 0, "reference").get_ydata(), 100.0)
    assert np.allclose(line(figure, 0, "actual").get_xdata(), np.arange(81) * 0.05)
    assert [line(figure, row, "applied").get_ydata()[0] for row in range(2, 6)] == [1.0, 0.2, 0.3, 0.4]
    assert list(figure.axes[2].get_yticks()) == [0.0, 4.0]
    assert list(figure.axes[5].get_yticks()) == [-1.0, 0.0, 1.0]


def test_a_diverging_run_does_not_press_the_reference_flat() -> None:
    rates = np.full(81, 100.0)
    rates[60:] = 1e4
    figure = tracking_figure(run_of(rates, outcome=Outcome.DIVERGED))
    assert figure.axes[0].get_ylim()[1] < 300.0
    assert "9900 deg/s" in texts(figure)


def test_a_recording_of_the_rest_starts_where_it_begins() -> None:
    whole = run_of(100.0, 90.0, skydiver(reference=rotation()))
    figure = tracking_figure(whole.since(30))
    assert "1.500 s" in texts(figure)
    assert "from the wanted 180 deg" in texts(tracking_figure(whole))
    assert "from the wanted" not in texts(figure)
    assert figure.axes[-1].get_xlim() == pytest.approx((1.5, 4.0))


@pytest.mark.parametrize("name", odd_runs())
def test_every_run_can_be_drawn(name: str) -> None:
    assert imread(BytesIO(png(tracking_figure(odd_runs()[name])))).shape[1] == 1200


def test_equal_runs_give_equal_files_whatever_the_user_has_set() -> None:
    plain = png(tracking_figure(run_of(scenario=cart())))
    with matplotlib.rc_context({"font.size": 30, "savefig.dpi": 10, "axes.grid": False}):
        assert png(tracking_figure(run_of(scenario=cart()))) == plain
        assert matplotlib.rcParams["font.size"] == 30
