# SPDX-License-Identifier: Apache-2.0
"""The step that `rk4` makes of a derivative: order, agreement with SciPy, forms, use by UTC."""

import pickle

import numpy as np
import pytest
from numba import njit
from scipy.integrate import solve_ivp

from skydiver_utc import FunctionPlant, UnscentedTransformController, rk4

GRAVITY = 9.81


def pendulum(state, control):
    """The derivative as a list."""
    return [state[1], control[0] - GRAVITY * np.sin(state[0]) - 0.1 * state[1]]


@njit
def jitted(state, control):
    return np.array([state[1], control[0] - GRAVITY * np.sin(state[0]) - 0.1 * state[1]])


def writing(state, control, out):
    out[:] = pendulum(state, control)


@njit
def jitted_writing(state, control, out):
    out[0] = state[1]
    out[1] = control[0] - GRAVITY * np.sin(state[0]) - 0.1 * state[1]


FORMS = (pendulum, jitted, writing, jitted_writing)
START, CONTROL = np.array([2.0, 0.5]), np.array([1.5])
EXACT = solve_ivp(
    lambda _, x: pendulum(x, CONTROL), (0.0, 2.0), START, method="RK45", rtol=1e-11, atol=1e-12
).y[:, -1]


def end(step, steps):
    """The state after 2 s in so many steps."""
    state = START
    for _ in range(steps):
        state = step(state, CONTROL, 2.0 / steps)
    return state


@pytest.mark.parametrize("derivative", FORMS)
def test_it_agrees_with_scipy_and_converges_with_order_four(derivative):
    step = rk4(derivative)
    errors = [np.abs(end(step, steps) - EXACT).max() for steps in (50, 100, 200)]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    np.testing.assert_allclose(orders, 4.0, atol=0.2)
    np.testing.assert_allclose(end(step, 1000), EXACT, atol=1e-10)


def test_utc_decides_alike_with_every_form():
    """Plain and jitted, returning and writing, and with an output of plain Python."""
    decisions = []
    settings = {"dt": 0.02, "horizon": 10, "minimum": -9.0, "maximum": 9.0}
    for derivative in FORMS:
        controller = UnscentedTransformController.of(
            rk4(derivative), lambda state: state[0], state=START, control=CONTROL, **settings
        )
        decisions.append([controller.step(START, 1.0).control[0] for _ in range(3)])
    np.testing.assert_allclose(decisions, [decisions[0]] * 4, rtol=1e-9)


def test_a_plain_step_can_go_to_another_process():
    step = pickle.loads(pickle.dumps(rk4(pendulum)))
    np.testing.assert_array_equal(step(START, CONTROL, 0.1), rk4(pendulum)(START, CONTROL, 0.1))


@pytest.mark.parametrize("wrong", [None, lambda x: x, lambda a, b, c, d: a, lambda a, *, b: a])
def test_another_form_is_refused(wrong):
    with pytest.raises(ValueError, match="derivative"):
        rk4(wrong)


@pytest.mark.parametrize("wrong", [lambda x, u: x[0], njit(lambda x, u: x[:1])])
def test_a_derivative_of_another_size_is_refused(wrong):
    """NumPy would spread it over the state."""
    with pytest.raises(ValueError, match="derivative"):
        FunctionPlant(rk4(wrong), state=START, control=CONTROL, dt=0.1)
