# SPDX-License-Identifier: Apache-2.0
"""The linear-quadratic gains against batch least squares over a long horizon."""

from functools import cache

import numpy as np
import pytest

from skydiver_utc import FunctionPlant
from skydiver_utc.controllers.linear_quadratic import LinearQuadraticController
from skydiver_utc.controllers.protocol import Status
from skydiver_utc.controllers.settings import LqrSettings

A = np.array([[0.9, 0.2, 0.0], [-0.1, 0.85, 0.1], [0.0, 0.05, 0.7]])
B = np.array([[0.1, 0.0], [0.0, 0.4], [0.3, 0.1]])
C = np.array([1.0, 0.5, -0.2])
W, S = np.array([0.1, 0.3]), np.array([0.5, 0.2])
STATE, CONTROL = np.array([0.4, -0.1, 0.2]), np.array([0.3, -0.6])


def controller_of(control, minimum, maximum, preview_steps):
    """The regulator of a linear plant about its equilibrium (STATE, CONTROL)."""
    plant = FunctionPlant(
        lambda x, u, dt: STATE + A @ (x - STATE) + B @ (u - CONTROL), lambda x: C @ x,
        state=STATE, control=control, dt=1.0, minimum=minimum, maximum=maximum,
    )  # fmt: skip
    squared_range = (plant.maximum - plant.minimum) ** 2
    tables = {"nominal": CONTROL, "cost": W * squared_range, "change_cost": S * squared_range}
    named = {name: dict(zip(("u0", "u1"), values.tolist(), strict=True)) for name, values in tables.items()}
    return LinearQuadraticController(LqrSettings(horizon_steps=preview_steps, **named), plant, ("y0",), 1.0)


@cache
def long_problem():
    """Outputs (steps, 3) by the state, and the first control (2, rows) by the right side of the least squares."""
    steps = 150
    n = 2 * steps
    response, state_of, free, power = np.zeros((steps, n)), np.zeros((3, n)), np.zeros((steps, 3)), np.eye(3)
    for k in range(steps):
        state_of, power = A @ state_of, A @ power
        state_of[:, 2 * k : 2 * k + 2] += B
        response[k], free[k] = C @ state_of, C @ power
    change = np.eye(n) - np.eye(n, k=-2)
    w, s = np.sqrt(np.tile(W, steps)), np.sqrt(np.tile(S, steps))
    return free, np.linalg.pinv(np.vstack([response, np.diag(w), s[:, None] * change]))[:2]


def best_first_control(z, u_before, reference):
    """The first control of the least-squares solution over many steps, the reference constant after its end."""
    free, first = long_problem()
    r = np.append(reference, np.full(len(free) - len(reference), reference[-1]))
    before = np.append(np.sqrt(S) * u_before, np.zeros(2 * len(free) - 2))
    return first @ np.concatenate([r - free @ z, np.zeros(2 * len(free)), before])


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("preview_steps", [1, 2, 25])
def test_the_first_control_is_that_of_the_long_least_squares_problem(seed, preview_steps):
    """Feedback, preview and the constant tail at once."""
    generator = np.random.default_rng(seed)
    z, u = generator.normal(size=3), generator.normal(size=2)
    preview = generator.normal(size=preview_steps + 1)
    controller = controller_of(CONTROL + u, -1e3, 1e3, preview_steps)
    decision = controller.decide(STATE + z, (C @ STATE + preview)[:, None])
    expected = CONTROL + best_first_control(z, u, preview[1:])
    np.testing.assert_allclose(decision.control, expected, atol=1e-9)
    assert decision.status is Status.SOLVED


def test_it_does_not_wind_up_at_a_limit():
    """After a long time at the limit the control leaves it as soon as one that had not been there would."""
    at_limit = np.array([0.35, 0.35])
    waited, fresh = (controller_of(at_limit, -0.65, 0.35, 5) for _ in range(2))
    for _ in range(200):
        decision = waited.decide(STATE, np.full((6, 1), 1e3))
    np.testing.assert_array_equal(decision.control, at_limit)
    assert decision.status is Status.SATURATED
    back = np.full((6, 1), -50.0)
    np.testing.assert_array_equal(waited.decide(STATE, back).control, fresh.decide(STATE, back).control)
