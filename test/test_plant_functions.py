"""What the functions of a user may raise and return: points that diverge, and slips that are named."""

import math
import re

import numba
import numpy as np
import pytest
import scipy.linalg
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


def singular(x, u, dt):
    """The mass is zero below zero: no solution there."""
    mass = np.array([[1.0 if x[0] >= 0.0 else 0.0]])
    return x + dt * np.linalg.solve(mass, u)


@pytest.mark.parametrize("jitted", [False, True], ids=["plain", "jitted"])
def test_a_mass_matrix_that_is_singular_at_one_point(jitted):
    """From 0.3 the points u = 0, sqrt(0.6 / 0.75) and its negative: the last is below zero on step 5 of 8.

    What is left are two points of weight 1/4 and 3/8, scaled to one: outputs 0.3 and 0.3 + 0.8 u, exactly linear.
    """
    drive = controller(
        numba.njit(error_model="numpy")(singular) if jitted else singular, None, state=[0.3], Pu=0.6
    )
    result = drive.step([0.3], 0.4)
    weights, points = np.array([0.25, 0.375]) / 0.625, np.array([0.0, np.sqrt(0.8)])
    mean = weights @ points
    variance = weights @ (points - mean) ** 2
    gain = 0.8 * variance / (0.64 * variance + 1e-4)
    np.testing.assert_allclose(result.control, mean + gain * (0.4 - 0.3 - 0.8 * mean), rtol=1e-12)
    assert (result.status, result.lost) == (Status.REPAIRED, 1)
    assert result.sentence.startswith(
        "Repaired: 1 of 3 sigma points diverged and were left out (plant raises LinAlgError on step 5: "
    )
    assert_usable(drive.step([0.3], 0.4))


@pytest.mark.parametrize("library", ["numpy", "scipy", "jitted"])
def test_a_linear_solve_inside_a_plant_that_overflows(library):
    """Each point overflows: the control is kept, and the next step is solved."""
    solve = {"scipy": scipy.linalg.solve}.get(library, np.linalg.solve)

    def plant(x, u, dt):
        return x + dt * solve(np.eye(2), np.array([x[0] ** 3 + u[0], x[1] ** 3]))

    drive = controller(
        numba.njit(error_model="numpy")(plant) if library == "jitted" else plant, None, horizon=20
    )
    result = drive.step([9.0, -50.0], [0.0, 0.0])
    assert_usable(result)
    assert (result.status, result.lost) == (Status.KEPT_PREVIOUS, 3)
    if library != "numpy":  # which answers NaN
        assert "3 of 3 sigma points diverged inside the horizon (plant raises " in result.sentence
    assert drive.step([0.0, 0.0], [0.01, 0.0]).status is not Status.KEPT_PREVIOUS


TABLE = tuple(range(10))


def looks_up(x, u, dt):
    return x + dt * u + 0.0 * TABLE[int(10.0 * abs(float(x[0])))]


def whole_number(x, u, dt):
    return x + dt * u + 0.0 * int(np.float64(1.0) / np.float64(float(x[0]) < 0.95))


def no_number(x, u, dt):
    return x + dt * u + 0.0 * int(np.float64(0.0) / np.float64(float(x[0]) < 0.95))


def fractional_power(x, u, dt):
    return np.array([float(x[0]) + dt * float(u[0]) + 0.0 * (0.95 - float(x[0])) ** 0.5])


def too_far(x, u, dt):
    if x[0] > 0.95:
        raise ValueError("too far")
    return x + dt * u


@pytest.mark.parametrize("place", ["plant", "output", "control_dynamics"])
@pytest.mark.parametrize(
    ("raising", "told"),
    [
        (looks_up, "IndexError"),
        (whole_number, "OverflowError"),
        (no_number, "ValueError"),
        (fractional_power, "ArithmeticError on step 8: it returns complex numbers"),
        (too_far, "ValueError on step 8: too far"),
        (numba.njit(too_far), "ValueError on step 8: too far"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_a_point_beyond_what_a_function_covers_has_diverged_and_the_sentence_tells_why(raising, told, place):
    """From 0.3 at +0.894 the state is 0.926 after seven steps and 1.016 after eight: all else stays inside.

    The horizon is one step longer than the plant's last good one: 9 steps for the plant, 8 for the output of it.
    """
    parts = {"plant": straight, "output": None, "control_dynamics": None, "horizon": 9}
    if place == "output":
        parts |= {"output": lambda x: raising(x, np.zeros(1), 0.0), "horizon": 8}
    elif place == "plant":
        parts |= {"plant": raising}
    else:
        parts |= {
            "control_dynamics": lambda point, control, state, preview, j: (
                point + raising(state, np.zeros(1), 0.0) - state
            )
        }
    drive = controller(**parts, state=[0.3], Pu=0.6)
    result = drive.step([0.3], 0.1)
    assert_usable(result)
    assert (result.status, result.lost) == (Status.REPAIRED, 1)
    step = 8 if place == "output" else 9
    assert f"left out ({place} raises {told.replace('step 8', f'step {step}')}" in result.sentence
    assert result.cause.startswith(f"{place} raises ")
    # Not told again by a step in which nothing diverges.
    assert drive.step([-0.2], -0.2).cause == ""


MISTAKES = {
    "TypeError": lambda x: x + None,
    "AttributeError": lambda x: x.position,
    "KeyError": lambda x: {}["mass"],
    "NameError": lambda x: mass,  # noqa: F821
    "NotImplementedError": lambda x: (_ for _ in ()).throw(NotImplementedError("stall")),
    "AssertionError": lambda x: (_ for _ in ()).throw(AssertionError("below ground")),
}


@pytest.mark.parametrize("where", ["plant", "output", "control_dynamics"])
@pytest.mark.parametrize("kind", MISTAKES)
def test_every_other_error_is_one_sentence_that_names_the_function_and_the_step(where, kind):
    """From 5.25 with a speed of 1 the state passes 5.5 after three steps of 0.1: the plant's fourth step fails."""

    def mistaken(name, value, state):
        return MISTAKES[kind](state) if name == where and state[0] > 5.5 else value

    drive = controller(
        lambda x, u, dt: mistaken("plant", x + np.array([dt, 0.0]) + 0.0 * u, x),
        lambda x: mistaken("output", x, x),
        control_dynamics=lambda point, control, state, preview, j: mistaken("control_dynamics", point, state),
    )
    assert_usable(drive.step([0.0, 0.0], [0.1, 0.0]))
    step = 8 if where == "output" else 4
    with pytest.raises(ValueError, match=rf"^{where} fails on step {step} of the horizon \({kind}") as raised:
        drive.step([5.25, 0.0], [0.1, 0.0])
    assert type(raised.value.__cause__).__name__ == kind
    assert str(raised.value).endswith(".")
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("kind", [RuntimeError, KeyError, AssertionError])
def test_an_error_of_a_jitted_plant_is_named_like_that_of_a_plain_one(kind):
    @numba.njit
    def plant(x, u, dt):
        if x[0] > 0.95:
            raise kind("stall")
        return x + dt * u

    drive = controller(plant, None, state=[0.3], Pu=0.6, horizon=9)
    with pytest.raises(
        ValueError, match=rf"^plant fails on step 9 of the horizon \({kind.__name__}: .*stall"
    ):
        drive.step([0.3], 0.1)
    assert_usable(drive.step([-0.5], -0.5))


@pytest.mark.parametrize("wrong", [np.zeros(1), np.zeros((2, 1)), np.zeros(3), 0.0, None], ids=str)
@pytest.mark.parametrize("where", ["plant", "output", "control_dynamics"])
def test_another_shape_inside_the_horizon_is_named(where, wrong):
    """NumPy would fill a state (2,) with one number."""

    def changing(name, value, state):
        return wrong if name == where and state[0] > 5.0 else value

    drive = controller(
        lambda x, u, dt: changing("plant", x + dt * u, x),
        lambda x: changing("output", x, x),
        control=[0.0, 0.0],
        control_dynamics=lambda point, control, state, preview, j: changing("control_dynamics", point, state),
    )
    assert_usable(drive.step([0.0, 0.0], [0.1, 0.1]))
    told = "TypeError: it returns None" if wrong is None else f"returns shape {np.shape(wrong)}"
    step = 8 if where == "output" else 1
    with pytest.raises(ValueError, match=f"^{where} .*{re.escape(told)}") as raised:
        drive.step([9.0, 9.0], [0.1, 0.1])
    assert f"on step {step} of the horizon" in str(raised.value)


def test_a_jitted_plant_that_returns_another_shape_is_named():
    @numba.njit
    def plant(x, u, dt):
        return x[:1] if x[0] > 5.0 else x + dt * u

    drive = controller(plant, None)
    with pytest.raises(
        ValueError, match=r"^plant returns shape \(1,\) on step 1 of the horizon instead of \(2,\)"
    ):
        drive.step([9.0, 0.0], [0.1, 0.1])


def test_one_number_stands_for_one_output_and_for_a_vector_of_one():
    wanted = controller(straight, lambda x: x, state=[0.0]).step([0.1], 0.2).control
    for output in (lambda x: x[0], lambda x: [x[0]], lambda x: np.array(x[0])):
        np.testing.assert_array_equal(
            controller(straight, output, state=[0.0]).step([0.1], 0.2).control, wanted
        )


def test_a_jitted_division_by_zero_is_a_divergence_too():
    @numba.njit
    def plant(x, u, dt):
        return np.array([x[0] + dt * u[0] / (x[0] - 2.0)])

    result = controller(plant, None, state=[0.0]).step([2.0], 0.1)
    assert (result.status, result.lost) == (Status.KEPT_PREVIOUS, 3)
    assert "(plant raises ZeroDivisionError on step 1: division by zero)" in result.sentence


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
    ({"horizon": "20"}, "horizon is '20'", "whole number"),
    ({"horizon": b"20"}, "horizon is b'20'", "whole number"),
    ({"horizon": None}, "horizon is None", "whole number"),
    ({"plant": lambda x, u, dt: None}, "plant returns None", "write its return"),
    ({"plant": numba.njit(lambda x, u, dt: None)}, "plant returns None", "write its return"),
    ({"output": lambda x: None}, "output returns None", "write its return"),
    ({"control_dynamics": lambda p, c, s, r, j: None}, "control_dynamics returns None", "write its return"),
    ({"plant": lambda x, u, dt, out: None}, "plant returns [nan, nan]", "finite"),
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
