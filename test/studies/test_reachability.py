# SPDX-License-Identifier: Apache-2.0
"""benchmarks/reachability.py: no control within the bounds turns the body faster than it says."""

import numpy as np
import pytest
import reachability
from scipy.optimize import minimize

from skydiver_utc.parameters import load_scenario
from skydiver_utc.plants.skydiver.model import build_model
from skydiver_utc.plants.skydiver.steady import HeldBody, straight_falls

SCENARIO = load_scenario("fast_turn_gauss_newton_held")


@pytest.mark.parametrize("yaw_rate", [-5.0, 0.0, 3.0, 7.0])
def test_the_largest_yaw_acceleration_against_a_search(yaw_rate: float) -> None:
    """SciPy's search from random starts finds as much and, but for the grid of alpha, no more."""
    model, limits = build_model(SCENARIO.plant, SCENARIO.dt_s), SCENARIO.plant.limits
    fall, rates = straight_falls(model)[0], np.array([0.3, -0.2, yaw_rate])
    bounds = [limits.Cm_damp_yaw, limits.k_right, limits.k_left, limits.alpha]
    random = np.random.default_rng(1)

    def slowness(control: np.ndarray) -> float:
        return -HeldBody(model, control).accelerations(fall.up, fall.velocity, rates)[5]

    starts = [random.uniform(*np.transpose(bounds)) for _ in range(12)]
    found = max(-minimize(slowness, start, bounds=bounds).fun for start in starts)
    largest = reachability.yaw_accelerations(
        reachability.bodies_at_the_bounds(SCENARIO), fall.velocity, rates
    ).max()
    assert largest == pytest.approx(found, rel=2e-3)


def test_a_slow_turn_asks_for_little_and_a_turn_nobody_flies_for_too_much() -> None:
    shares = reachability.of_sines(SCENARIO, (100, 400), (0.05, 0.3))
    assert shares[0, 0] < 0.1
    assert shares[1, 1] > 1.0
