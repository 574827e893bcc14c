# SPDX-License-Identifier: Apache-2.0
"""Whether a filter says of itself that it can, or cannot, be believed."""

import nees
import numpy as np
import pytest

from skydiver_utc.analysis.estimation import estimation_errors
from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.analysis.validation_figure import validation_figure
from skydiver_utc.estimators.consistency import consistency
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.parameters import load_scenario

RUNS = 100


def test_the_nees_of_many_runs_lies_in_its_band():
    """At each step with 95 %; neighbouring steps are alike, so that fewer of them may."""
    mean, (low, high) = nees.nees(RUNS).mean(axis=0), nees.bounds(RUNS)
    assert np.mean((mean >= low) & (mean <= high)) > 0.85
    assert mean.mean() == pytest.approx(2.0, abs=0.1)
    assert nees.nees(RUNS // 4, assumed_noise=0.5 * nees.NOISE).mean() > 2.5


@pytest.mark.parametrize(
    ("change", "verdict"),
    [
        (lambda white: white, "consistent"),
        (lambda white: 1.2 * white, "overconfident"),
        (lambda white: 0.8 * white, "cautious"),
        (lambda white: (white[1:] + 0.5 * white[:-1]) / np.sqrt(1.25), "not white"),
        (lambda white: white[:5], "too few"),
    ],
)
def test_a_verdict_on_innovations(change, verdict):
    found = change(np.random.default_rng(0).standard_normal((1000, 3)))
    assert consistency(found).verdict == verdict


@pytest.fixture(scope="module")
def runs():
    """A flight on sensors without biases, and on ones with biases that the filter does not know."""
    biased = {"estimator.sensors.gyroscope.bias": 0.02}
    return [
        simulate(load_scenario("fast_turn_gyro_accelerometer", {"duration_s": 4.0} | changes))
        for changes in ({}, biased)
    ]


def test_metrics_of_a_run_tell_a_bias_that_the_filter_does_not_know(runs):
    fair, biased = (metrics(run)["estimation"] for run in runs)
    assert fair["sensors"]["gyroscope"]["verdict"] in ("consistent", "cautious")
    assert biased["sensors"]["gyroscope"]["verdict"] == "overconfident"
    low, high = fair["sensors"]["accelerometer"]["nis_bounds"]
    assert low < 3.0 < high
    assert fair["states"]["attitude_x"]["inside_two_deviations"] > 0.8
    assert fair["states"]["wz"]["rmse"] < 0.01
    assert "estimation" not in metrics(simulate(load_scenario("bank_recovery", {"duration_s": 0.1})))


def test_the_figure_has_two_panels_for_each_sensor_and_one_for_each_state(runs):
    figure = validation_figure(runs[0])
    assert len(figure.axes) == 2 * 2 + len(estimation_errors(runs[0]))
    assert all(axes.get_title(loc="left") for axes in figure.axes)
