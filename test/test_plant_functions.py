"""What the functions of a user may raise and return: points that diverge, and slips that are named."""

import math
import re

import numba
import numpy as np
import pytest
from test_unscented_controller import assert_usable, cart, controller, position

from skydiver_utc import Status


def straight(x, u, dt):
    return x + dt * u


def divides(x, u, dt):
    """Plain floats raise ZeroDivisionError where x has left 0 .. 2."""
    return np.array([float(x[0]) + dt * float(u[0]) + 0.0 / float(abs(float(x[0]) - 1.0) <= 1.0)])


def square_root_of(x, u, dt):
    return np.array([math.sqrt(float(x[0])) + dt * float(u[0]) + float(x[0]) - math.sqrt(float(x[0]))])


def inverts(x, u, dt):
    return x + dt * u + 0.0 * np.linalg.inv([[float(x[0] >= 0.0)]])[0]


def logarithm(x):
    return math.log(float(x[0]))


def one_over(x):
    return 1.0 / float(x[0] > 0.0)


def dynamics_with_a_root(point, control, state, preview, j):
    return point + 0.0 * math.sqrt(float(state[0]))


def dynamics_that_divide(point, control, state, preview, j):
    return point * (1.0 / float(state[0] > 0.0))


RAISING = [
    (divides, None, None),
    (square_root_of, None, None),
    (inverts, None, None),
    (straight, logarithm, None),
    (straight, one_over, None),
    (straight, None, dynamics_with_a_root),
    (straight, None, dynamics_that_divide),
]


@pytest.mark.parametrize("square_root", [False, True])
@pytest.mark.parametrize(
    ("plant", "output", "dynamics"),
    RAISING,
    ids=lambda function: getattr(function, "__name__", ""),
)
def test_a_point_whose_arithmetic_fails_has_diverged(plant, output, dynamics, square_root):
    """From 0.3 eight steps of 0.1 at -1 end below zero, where the arithmetic fails; at 0 and 1 they do not."""
    drive = controller(
        plant, output, state=[0.3], control_dynamics=dynamics, Pu=0.6, square_root=square_root,
    )  # fmt: skip
    result = drive.step([0.3], 0.1)
    assert_usable(result)
    assert (result.status, result.lost) == (Status.REPAIRED, 1)
    assert "1 of 3 sigma points diverged" in result.sentence


@pytest.mark.parametrize("where", ["plant", "output", "control_dynamics"])
def test_what_is_no_arithmetic_is_raised_as_it_is(where):
    """A mistake of the user's own code that shows itself late is not taken for a divergence."""

    def mistaken(name, value, state):
        if name == where and state[0] > 5.0:
            raise ValueError("the table ends at 5")
        return value

    drive = controller(
        lambda x, u, dt: mistaken("plant", x + dt * u, x),
        lambda x: mistaken("output", x, x),
        state=[0.0],
        control_dynamics=lambda point, control, state, preview, j: mistaken("control_dynamics", point, state),
    )
    assert_usable(drive.step([0.0], 0.1))
    with pytest.raises(ValueError, match="the table ends at 5"):
        drive.step([9.0], 0.1)


def test_a_jitted_plant_that_raises_is_named():
    @numba.njit
    def plant(x, u, dt):
        return np.array([x[0] + dt * u[0] / (x[0] - 2.0)])

    drive = controller(plant, None, state=[0.0])
    with pytest.raises(
        ValueError, match=r"plant is jitted, .*ZeroDivisionError.*error_model=\"numpy\""
    ) as raised:
        drive.step([2.0], 0.1)
    assert "\n" not in str(raised.value)


def test_a_fourth_parameter_with_a_default_is_no_output_array():
    def plant(x, u, dt, mass=2.0):
        return np.array([x[0] + dt * x[1], x[1] + dt * u[0] / mass])

    def halved(x, u, dt):
        return plant(x, u, dt)

    for form in (plant, numba.njit(plant)):
        result = controller(form).step([0.0, 0.0], 0.05)
        np.testing.assert_allclose(
            result.control, controller(halved).step([0.0, 0.0], 0.05).control, rtol=1e-12
        )


def slip(x, u, dt):
    """The commonest: u is an array of one."""
    return np.array([x[0] + dt * x[1], x[1] + dt * u])


def keyword_only(x, u, dt, *, mass):
    return x


def too_short(x):
    return x[5]


WRONG = [
    ({"plant": slip}, "plant fails on the example given", "u[0]"),
    ({"plant": numba.njit(slip)}, "plant fails on the example given", "u[0]"),
    ({"plant": keyword_only}, "plant must be a function", "mass needs a default"),
    ({"plant": max}, "plant must be a function", ""),
    ({"plant": 3}, "plant must be a function", "not 3"),
    ({"plant": lambda x, u, dt: x * 1j}, "plant fails on the example given", "complex"),
    ({"plant": lambda x, u, dt, p, q: x}, "plant must be a function", "5 parameters without a default"),
    ({"control_dynamics": 3}, "control_dynamics must be a function", "not 3"),
    ({"control_dynamics": lambda point: point}, "control_dynamics fails on the example given", ""),
    ({"control_dynamics": lambda p, c, s, r, j: s}, "control_dynamics returns shape (2,)", "(1,)"),
    ({"output": too_short}, "output fails on the example given", "IndexError"),
    ({"output": lambda x: "far"}, "output fails on the example given", "far"),
    ({"square_root": "no"}, "square_root is 'no'", "True or False"),
    ({"horizon": "8"}, "horizon is '8'", "whole number"),
    ({"horizon": None}, "horizon is None", "whole number"),
    ({"state": [0.0, 1j]}, "state must be numbers", ""),
    ({"state": [[0.0], [1.0, 2.0]]}, "state must be numbers", ""),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "begins", "tells"), WRONG, ids=lambda value: str(value)[:30])
def test_a_slip_is_told_in_one_sentence(changes, begins, tells):
    with pytest.raises(ValueError, match="^" + re.escape(begins)) as raised:
        controller(**changes)
    assert tells in str(raised.value)
    assert str(raised.value).endswith(".")
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("state", ["x", [[0.0], [1.0, 2.0]], [0.0, 1j], np.array([0.0, 1j]), None])
def test_a_state_that_is_no_vector_of_numbers_is_named(state):
    with pytest.raises(ValueError, match=r"^state (must be numbers|has shape)"):
        controller().step(state, 0.1)


def test_a_horizon_may_be_an_array_of_numpy():
    expected = controller(cart, position, horizon=8).step([0.0, 0.0], 0.1).control
    np.testing.assert_array_equal(controller(horizon=np.array(8)).step([0.0, 0.0], 0.1).control, expected)
