# SPDX-License-Identifier: Apache-2.0
"""Gauss-Newton control on a linear plant: one step is the constrained least-squares solution, which SciPy finds."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from skydiver_utc import FunctionPlant
from skydiver_utc.controllers.gauss_newton import GaussNewtonController
from skydiver_utc.controllers.protocol import Status
from skydiver_utc.controllers.settings import GaussNewtonSettings

A = np.array([[0.9, 0.2], [-0.1, 0.95]])
B = np.array([[0.1, 0.0, 0.3], [0.2, 0.4, -0.1]])
C = np.array([1.0, 0.5])
STATE = np.array([0.3, -0.2])
APPLIED = np.array([0.1, -0.05, 0.2])
COST, CHANGE_COST = np.array([0.02, 0.01, 0.03]), np.array([0.05, 0.02, 0.04])
REST = np.array([0.1, 0.0, -0.1])
STEPS, BLOCKS, HOLD = 6, 3, 2
WIDE = np.full(3, 100.0)
NO_RATE = np.full(3, np.inf)
NAMES = ("a", "b", "c")


def controls(sequence, applied, ramped):
    """The control (N, m) in each step of a sequence (B, m): held, or on an even way through the block."""
    before = np.vstack([applied, sequence[:-1]])
    rows = []
    for j in range(STEPS):
        b, share = j // HOLD, (j % HOLD + 1) / HOLD
        rows.append(np.where(ramped, before[b] + share * (sequence[b] - before[b]), sequence[b]))
    return np.array(rows)


def outputs_of(state, applied, sequence, ramped):
    y, x = [], state
    for u in controls(sequence, applied, ramped):
        x = A @ x + B @ u
        y.append(C @ x)
    return np.array(y)


def least_squares(reference, ramped):
    """M and t such that J = |M x - t|^2 in the flat sequence x, from superposition."""
    n = BLOCKS * 3
    free = outputs_of(STATE, APPLIED, np.zeros((BLOCKS, 3)), ramped)
    response = np.array(
        [outputs_of(STATE * 0, APPLIED * 0, unit.reshape(-1, 3), ramped) for unit in np.eye(n)]
    ).T
    change = np.eye(n) - np.eye(n, k=-3)
    before = np.concatenate([APPLIED, np.zeros(n - 3)])
    s, w = np.sqrt(np.tile(CHANGE_COST, 3) / 3), np.sqrt(np.tile(COST, 3) / 3)
    M = np.vstack([response / np.sqrt(6), w[:, None] * np.eye(n), s[:, None] * change])
    t = np.concatenate([(reference[1:] - free) / np.sqrt(6), w * np.tile(REST, 3), s * before])
    return M, t, change, before


def controller_of(minimum, maximum, rate):
    own = FunctionPlant(
        lambda x, u, dt: A @ x + B @ u, lambda x: C @ x, state=STATE, control=APPLIED, dt=1.0,
        minimum=minimum, maximum=maximum, rate=rate, control_names=NAMES,
    )  # fmt: skip
    squared_range = (own.maximum - own.minimum) ** 2
    tables = {"nominal": REST, "cost": COST * squared_range, "change_cost": CHANGE_COST * squared_range}
    named = {name: dict(zip(NAMES, values.tolist(), strict=True)) for name, values in tables.items()}
    return GaussNewtonController(
        GaussNewtonSettings(horizon_steps=STEPS, blocks=BLOCKS, **named), own, ("y0",), 1.0
    )


@pytest.mark.parametrize(
    ("low", "high", "reference", "status", "tolerance"),
    [
        (-WIDE, WIDE, np.linspace(0.0, 1.0, 7), Status.SOLVED, {"rtol": 1e-8}),
        (
            np.array([0.0, -0.1, -0.3]),
            np.array([0.4, 0.3, 0.25]),
            np.full(7, 3.0),
            Status.SATURATED,
            {"rtol": 0.0, "atol": 1e-8},
        ),
    ],
    ids=["free", "bounded"],
)
def test_with_magnitude_limits_it_is_bounded_least_squares(low, high, reference, status, tolerance):
    M, t, *_ = least_squares(reference, np.isfinite(NO_RATE))
    expected = lsq_linear(M, t, (np.tile(low, 3), np.tile(high, 3)), method="bvls").x[:3]
    decision = controller_of(low, high, NO_RATE).decide(STATE, reference[:, None])
    assert np.isin(expected, [low, high]).any() == (status is Status.SATURATED)
    np.testing.assert_allclose(decision.control, expected, **tolerance)
    assert decision.status is status


@pytest.mark.parametrize(
    ("reference", "slew", "bounded_in"),
    [
        (np.full(7, 3.0), np.array([0.05, 0.1, 0.02]), "first"),
        (np.full(7, -3.0), np.array([0.05, 0.1, 0.02]), "first"),
        (np.array([0, 0, 0, 0, 0, 2.0, 2.0]), np.array([0.5, 0.5, 0.5]), "later"),
    ],
    ids=["up", "down", "late"],
)
def test_with_rate_limits_it_is_bounded_least_squares_in_the_changes(reference, slew, bounded_in):
    """Magnitudes out of reach, so that the changes from block to block are the bounded unknowns."""
    M, t, change, before = least_squares(reference, np.isfinite(slew))
    to_sequence = np.linalg.inv(change)
    allowed = np.tile(slew * HOLD, 3)
    found = lsq_linear(M @ to_sequence, t - M @ to_sequence @ before, (-allowed, allowed), method="bvls").x
    decision = controller_of(-WIDE, WIDE, slew).decide(STATE, reference[:, None])
    at_limit = np.abs(found) == allowed
    assert at_limit[:3].any() == (bounded_in == "first")
    assert at_limit[3:].any()
    # The first of the two periods of the first block takes half of the block's change.
    np.testing.assert_allclose(decision.control, APPLIED + found[:3] / HOLD, atol=1e-8)


def test_more_iterations_reach_the_minimum_of_a_curved_plant():
    """y = u + 0.3 u^2, one held control: the stationary point of J by hand."""
    own = FunctionPlant(
        lambda x, u, dt: u + 0.3 * u**2, state=[0.0], control=0.0, dt=1.0, minimum=-5.0, maximum=5.0
    )
    law = GaussNewtonSettings(
        horizon_steps=1, blocks=1, iterations=40, cost={"u0": 10.0}, change_cost={"u0": 1e-7}
    )
    controller = GaussNewtonController(law, own, ("y0",), 1.0)
    u = controller.decide(np.zeros(1), np.full((2, 1), 1.5)).control[0]
    assert (u + 0.3 * u**2 - 1.5) * (1 + 0.6 * u) + 0.1 * u == pytest.approx(0.0, abs=1e-4)
