# SPDX-License-Identifier: Apache-2.0
"""What the functions of a user may raise and return: points that diverge, and mistakes that are named."""

import math
import re

import numba
import numpy as np
import pytest
from carts import assert_usable, cart, controller, position, straight

from skydiver_utc import Status

TABLE = tuple(range(10))


def ends_at_one(x):
    """Raises beyond 0.95."""
    if x[0] > 0.95:
        raise ValueError("too far")
    return x


RAISING = {
    "ZeroDivisionError": lambda x: x + 0.0 / float(x[0] < 0.95),
    "ValueError": lambda x: x + 0.0 * math.sqrt(0.95 - float(x[0])),
    "LinAlgError": lambda x: x + 0.0 * np.linalg.inv([[float(x[0] < 0.95)]])[0],
    "IndexError": lambda x: x + 0.0 * TABLE[int(10.0 * abs(float(x[0])))],
    "OverflowError": lambda x: x + 0.0 * int(np.float64(1.0) / np.float64(float(x[0]) < 0.95)),
    "too far": ends_at_one,
    "too far jitted": numba.njit(ends_at_one),
}


def with_one(place, wrong):
    """Plant, output and control dynamics, one of which passes its state through another function."""
    return {
        "plant": (lambda x, u, dt: wrong(x) + dt * u) if place == "plant" else straight,
        "output": (lambda x: wrong(x)) if place == "output" else None,
        "dynamics": (lambda point, control, state, preview, j: point + wrong(state) - state)
        if place == "dynamics"
        else None,
    }


@pytest.mark.parametrize("place", ["plant", "output", "dynamics"])
@pytest.mark.parametrize("raised", RAISING)
def test_a_point_beyond_what_a_function_covers_has_diverged_and_the_cause_is_told(raised, place):
    """From 0.3 at +0.894 the state is 0.926 after seven steps and 1.016 after eight; all other points stay below.

    A plant meets the state after eight steps in its ninth, an output in the eighth.
    """
    drive = controller(
        **with_one(place, RAISING[raised]), state=[0.3], Pu=0.6, horizon=8 if place == "output" else 9
    )
    result = drive.step([0.3], 0.1)
    assert_usable(result)
    assert (result.status, result.lost) == (Status.REPAIRED, 1)
    assert result.cause in result.sentence
    assert result.cause.startswith(f"{place} raises ")
    assert raised.partition(" jitted")[0] in result.cause
    assert drive.step([-0.2], -0.2).cause == ""


def test_a_jitted_division_by_zero_is_a_divergence_too():
    @numba.njit
    def plant(x, u, dt):
        return np.array([x[0] + dt * u[0] / (x[0] - 2.0)])

    result = controller(plant, None, state=[0.0]).step([2.0], 0.1)
    assert (result.status, result.lost) == (Status.KEPT_PREVIOUS, 3)
    assert "plant raises ZeroDivisionError" in result.cause


def throw(error):
    raise error


MISTAKES = {
    "TypeError": lambda x: x + None,
    "AttributeError": lambda x: x.position,
    "KeyError": lambda x: {}["mass"],
    "NameError": lambda x: mass,  # noqa: F821
    "NotImplementedError": lambda x: throw(NotImplementedError("stall")),
    "AssertionError": lambda x: throw(AssertionError("below ground")),
}


@pytest.mark.parametrize("place", ["plant", "output", "dynamics"])
@pytest.mark.parametrize("kind", MISTAKES)
def test_every_other_error_is_one_sentence_that_names_the_function(kind, place):
    drive = controller(**with_one(place, lambda x: MISTAKES[kind](x) if x[0] > 5.5 else x), state=[0.0])
    assert_usable(drive.step([0.0], 0.1))
    with pytest.raises(ValueError, match=rf"^{place} .*{kind}") as raised:
        drive.step([9.0], 0.1)
    assert type(raised.value.__cause__).__name__ == kind
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("gain", [1.25, 2.5])
def test_what_is_kept_of_a_jitted_plant_is_for_its_own_constants_only(gain):
    """The same text in the same file, with another constant around it: y = gain u, wanted at 1."""

    @numba.njit
    def plant(x, u, dt):
        return gain * u

    drive = controller(plant, None, state=[0.0], horizon=1, P_err=1e-9)
    np.testing.assert_allclose(drive.step([0.0], 1.0).control, 1.0 / gain, rtol=1e-6)


@pytest.mark.parametrize("kind", [RuntimeError, KeyError, AssertionError])
def test_an_error_of_a_jitted_plant_is_named_like_that_of_a_plain_one(kind):
    @numba.njit
    def plant(x, u, dt):
        if x[0] > 0.95:
            raise kind("stall")
        return x + dt * u

    drive = controller(plant, None, state=[0.3], Pu=0.6, horizon=9)
    with pytest.raises(ValueError, match=rf"^plant .*{kind.__name__}: .*stall"):
        drive.step([0.3], 0.1)
    assert_usable(drive.step([-0.5], -0.5))


@pytest.mark.parametrize("jitted", [False, True], ids=["plain", "jitted"])
@pytest.mark.parametrize("place", ["plant", "output", "dynamics"])
def test_another_number_of_values_inside_the_horizon_is_named(place, jitted):
    def changing(x):
        return x[:1] if x[0] > 5.0 else x

    plant = (lambda x, u, dt: changing(x) + dt * u[0]) if place == "plant" else straight
    output = changing if place == "output" else (lambda x: x)
    dynamics = (
        (lambda p, c, s, r, j: changing(10.0 - s)) if place == "dynamics" else (lambda p, c, s, r, j: p)
    )
    if jitted:
        changing, plant, output, dynamics = map(numba.njit, (changing, plant, output, dynamics))
    drive = controller(plant, output, dynamics=dynamics)
    assert_usable(drive.step([0.0, 0.0], [0.1, 0.1]))
    with pytest.raises(ValueError, match=f"^{place} .*TypeError"):
        drive.step([9.0, 9.0], [0.1, 0.1])


def test_one_number_stands_for_one_output_and_for_a_vector_of_one():
    wanted = controller(straight, lambda x: x, state=[0.0]).step([0.1], 0.2).control
    for output in (lambda x: x[0], lambda x: [x[0]], lambda x: np.array(x[0])):
        found = controller(straight, output, state=[0.0]).step([0.1], 0.2).control
        np.testing.assert_array_equal(found, wanted)


def test_a_fourth_parameter_with_a_default_is_no_array_to_write_to():
    def plant(x, u, dt, mass=2.0):
        return np.array([x[0] + dt * x[1], x[1] + dt * u[0] / mass])

    expected = controller(lambda x, u, dt: plant(x, u, dt)).step([0.0, 0.0], 0.05).control
    for form in (plant, numba.njit(plant)):
        np.testing.assert_allclose(controller(form).step([0.0, 0.0], 0.05).control, expected, rtol=1e-12)


def slip(x, u, dt):
    """The commonest: u is an array of one."""
    return np.array([x[0] + dt * x[1], x[1] + dt * u])


def keyword_only(x, u, dt, *, mass):
    return x


WRONG = [
    ({"plant": slip}, "plant .*control is an array"), ({"plant": numba.njit(slip)}, "plant .*control is an array"),
    ({"plant": keyword_only}, "plant must be a function"), ({"plant": 3}, "plant must be a function"),
    ({"plant": lambda x, u, dt, p, q: x}, "plant must be a function"),
    ({"plant": lambda x, u, dt: x * 1j}, "plant .*complex"), ({"plant": lambda x, u, dt: None}, "plant .*None"),
    ({"plant": numba.njit(lambda x, u, dt: None)}, "plant .*None"),
    ({"plant": lambda x, u, dt, out: None}, "plant .*finite"), ({"plant": lambda x, u, dt: x[:1]}, r"plant .*\(1,\)"),
    ({"plant": lambda x, u, dt: x / 0.0}, "plant"),
    ({"output": 3}, "output must be a function"), ({"output": lambda x: x[5]}, "output .*IndexError"),
    ({"output": lambda x: "far"}, "output .*far"), ({"output": lambda x: None}, "output .*None"),
    ({"output": lambda x: np.zeros((2, 2))}, r"output .*\(2, 2\)"), ({"output": lambda x: np.nan}, "output .*finite"),
    ({"dynamics": 3}, "dynamics must be a function"), ({"dynamics": lambda point: point}, "dynamics"),
    ({"dynamics": lambda p, c, s, r, j: s}, r"dynamics .*\(2,\)"),
    ({"dynamics": lambda p, c, s, r, j: None}, "dynamics .*None"),
    ({"dynamics": lambda p, c, s, r, j: r[9]}, "dynamics .*IndexError"),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "named"), WRONG, ids=lambda value: re.sub(" at 0x.*", "", str(value)))
def test_a_function_that_cannot_be_used_is_named_at_the_start(changes, named):
    with np.errstate(all="ignore"), pytest.raises(ValueError, match="^" + named) as raised:
        controller(**({"plant": cart, "output": position} | changes))
    assert "\n" not in str(raised.value)


def test_an_output_that_does_not_compile_with_a_jitted_plant_is_named():
    class NotForNumba:
        pass

    thing = NotForNumba()
    with pytest.raises(ValueError, match="output"):
        controller(numba.njit(cart), lambda x: 1.0 if thing else 0.0).step([0.0, 0.0], 0.1)
