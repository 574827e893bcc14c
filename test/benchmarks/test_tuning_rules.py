# SPDX-License-Identifier: Apache-2.0
"""The rules of docs/tuning.md: what is measured is what their formulas say."""

from math import factorial
from pathlib import Path

import numpy as np
import pytest
from tuning_rules import (
    DT,
    HORIZONS,
    ORDERS,
    RATIOS,
    chain,
    gain_of,
    overshoot,
    overshoot_of_slow_actuator,
    time_constant,
    tracking,
)

from skydiver_utc import UnscentedTransformController

pytestmark = pytest.mark.long

PAGE = (Path(__file__).parents[2] / "docs" / "tuning.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("horizon", HORIZONS)
def test_the_horizon_is_the_time_constant(horizon):
    """Between two steps the control is held: half a step less."""
    found = time_constant(horizon)
    assert found == pytest.approx((horizon - 0.5) * DT, rel=0.02)


@pytest.mark.parametrize("horizon", [*HORIZONS, 25])
def test_a_slow_actuator_overshoots_a_short_horizon(horizon):
    found = overshoot_of_slow_actuator(horizon)
    assert found == pytest.approx(max(0.5 - horizon * DT, 0.0), abs=0.01)


@pytest.mark.parametrize("order", ORDERS)
def test_overshoot_of_a_chain_of_integrators(order):
    """That of the polynomial 1 + s + .. + s^n / n!, whose roots are in units of the horizon, 0.4 s."""
    coefficients = [1.0 / factorial(i) for i in range(order, -1, -1)]
    poles = np.roots(coefficients).astype(complex) / 0.4
    time = DT * np.arange(250)
    derivative = np.poly1d(coefficients).deriv()
    residues = [1.0 / (p * 0.4 * derivative(p * 0.4)) for p in poles]
    step = 1.0 + np.real(sum(r * np.exp(p * time) for r, p in zip(residues, poles, strict=True)))
    alone, with_rates = overshoot(order, False), overshoot(order, True)
    assert alone == pytest.approx(max(step.max() - 1.0, 0.0), rel=0.25, abs=0.01)
    assert with_rates < 0.005


@pytest.mark.parametrize("ratio", RATIOS)
def test_the_share_of_the_innovation_taken(ratio):
    share, rmse, change = tracking(ratio)
    assert share == pytest.approx(gain_of(ratio), rel=1e-6)
    assert f"| {ratio:g} | {share:.2f} | {rmse:.3f} | {change:.3f} |" in PAGE


def test_peaks_under_a_preview():
    """x' = (r(t + T) - x) / T: a sine of 2 rad/s is lower by sqrt(1 + (2 T)^2), and not late."""
    N, K = 10, 400
    controller = UnscentedTransformController.of(
        chain, state=[0.0], control=0.0, dt=DT, horizon=N, Pu=1.0, Qu=1.0, P_err=1e-12
    )
    state, states = np.zeros(1), []
    for k in range(K):
        states.append(state[0])
        state = chain(
            state, controller.step(state, np.sin(2.0 * DT * np.arange(k, k + N + 1))[:, None]).control, DT
        )
    phases = 2.0 * DT * np.arange(K)[K // 2 :]
    wave = np.linalg.lstsq(np.stack([np.sin(phases), np.cos(phases)], axis=1), states[K // 2 :], rcond=None)[
        0
    ]
    assert np.hypot(*wave) == pytest.approx(1.0 / np.hypot(1.0, 2.0 * (N - 0.5) * DT), rel=1e-3)
    assert abs(np.arctan2(wave[1], wave[0])) < 0.04


def test_a_control_leaves_its_bound_at_once():
    """After 4 s on the bound under a reference out of reach: nothing is wound up."""
    plant = lambda x, u, dt: x + dt * (u - x)  # noqa: E731
    controller = UnscentedTransformController.of(
        plant, state=[0.0], control=0.0, dt=DT, horizon=10, minimum=-1.0, maximum=1.0
    )
    state = np.zeros(1)
    for _ in range(200):
        control = controller.step(state, 5.0).control
        state = plant(state, control, DT)
    assert control[0] == 1.0
    assert controller.step(state, 0.5).control[0] < 0.5
