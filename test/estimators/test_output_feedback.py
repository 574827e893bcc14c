# SPDX-License-Identifier: Apache-2.0
"""The skydiver flown on a gyroscope and an accelerometer alone."""

import numpy as np
import pytest
from pinned import PINNED

from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.parameters import load_scenario

BIASES = {"gyroscope": 0.01745, "accelerometer": 0.2}


@pytest.mark.long
def test_the_fast_turn_is_tracked_nearly_as_with_the_full_state_and_with_biases_that_are_found():
    full = PINNED["fast_turn_unknown_dynamics"]["rmse_deg_s"]
    assert PINNED["fast_turn_gyro_accelerometer"]["rmse_deg_s"] < 1.5 * full
    biased = {f"estimator.sensors.{name}.{field}": value for name, value in BIASES.items() for field in
              ("bias", "bias_deviation")}  # fmt: skip
    found = metrics(simulate(load_scenario("fast_turn_gyro_accelerometer", biased)))
    assert found["rmse_deg_s"] < 2.0 * full


def test_a_straight_fall_stays_belly_to_earth_for_a_minute():
    assert load_scenario("straight_fall_gyro_accelerometer").duration_s >= 60.0
    assert PINNED["straight_fall_gyro_accelerometer"]["min_dorsal_axis"] > np.cos(np.deg2rad(30.0))


def test_a_run_has_estimate_deviation_and_innovations_and_the_same_bits_again():
    scenario = load_scenario("fast_turn_gyro_accelerometer", {"duration_s": 0.5})
    run, again = simulate(scenario), simulate(scenario)
    np.testing.assert_array_equal(run.states, again.states)
    np.testing.assert_array_equal(run.telemetry, again.telemetry)
    other = simulate(scenario.replace(seed=1))
    assert not np.array_equal(run.states, other.states)

    def of(prefix):
        return run.telemetry[:, [n.startswith(prefix) for n in run.telemetry_names]]

    quaternion = of("estimate_q")
    np.testing.assert_allclose(np.linalg.norm(quaternion, axis=1), 1.0, atol=1e-12)
    assert np.isfinite(of("deviation_")).all()
    measured = np.isfinite(of("nis_gyroscope")[:, 0])
    assert measured.sum() == 24
    np.testing.assert_allclose(
        np.square(of("innovation_gyroscope")[measured]).sum(axis=1), of("nis_gyroscope")[measured, 0]
    )
