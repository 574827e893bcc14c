# SPDX-License-Identifier: Apache-2.0
"""What users do with a controller between its steps: set, read, copy, send to another process, ask."""

import copy
import pickle
import re
from dataclasses import replace

import numba
import numpy as np
import pytest
from carts import cart, controller, position, straight

from skydiver_utc import Status

jitted_cart, jitted_position = numba.njit(cart), numba.njit(position)


def test_an_unknown_attribute_is_refused_by_name():
    drive = controller()
    with pytest.raises(AttributeError, match="P_er"):
        drive.P_er = 1.0
    with pytest.raises(AttributeError):
        drive.control = [0.0]


def test_what_is_set_can_be_read_and_holds_from_the_next_step():
    """A smaller P_err moves the control further, narrower bounds and rates less."""
    changes = {"P_err": 1e-6, "Qu": 0.3, "minimum": -0.5, "maximum": 0.02, "rate": 0.1, "dt": 0.05}
    plain = controller(P_err=1e-2, rate=9.0).step([0.0, 0.0], 0.03)
    for name, value in changes.items():
        drive = controller(P_err=1e-2, rate=9.0)
        setattr(drive, name, value)
        np.testing.assert_allclose(
            getattr(drive, name), np.broadcast_to(value, np.shape(getattr(drive, name)))
        )
        result = drive.step([0.0, 0.0], 0.03)
        equal = np.array_equal(result.control, plain.control) and np.array_equal(
            result.covariance, plain.covariance
        )
        assert equal is (name == "minimum")
    drive = controller()
    drive.P_err = 0.3
    drive.step([0.0, 0.0], 0.03)
    assert drive.P_err == 0.3


@pytest.mark.parametrize(
    ("name", "value", "named"),
    [
        ("P_err", 0.0, "P_err"), ("P_err", [1.0, 2.0], "P_err"), ("Qu", -1.0, "Qu"), ("minimum", 2.0, "minimum"),
        ("maximum", [1.0, 2.0], "maximum"), ("rate", 0.0, "rate"), ("dt", -0.1, "dt"),
    ],
)  # fmt: skip
def test_what_cannot_be_set_is_named_and_changes_nothing(name, value, named):
    drive = controller()
    before = np.copy(getattr(drive, name))
    with pytest.raises(ValueError, match=named):
        setattr(drive, name, value)
    np.testing.assert_array_equal(getattr(drive, name), before)


def test_another_dt_goes_on_from_the_same_control():
    """The cart at 0.1, then at 0.05: one step equals that of a controller made for 0.05."""

    def told(drive):
        states, _ = drive.look_ahead(np.array([0.01, 0.0]), np.full((12, 1), 0.05), 3)
        return [*states.ravel(), *drive.explain([0.01, 0.0], 0.05).moves.ravel()]

    drive = controller(P_err=1e-3, rate=3.0)
    before = drive.step([0.0, 0.0], 0.05)
    told(drive)
    drive.dt = 0.05
    fresh = controller(P_err=1e-3, rate=3.0, dt=0.05)
    fresh.reset(before.control, before.covariance)
    result, expected = (made.step([0.01, 0.0], 0.05) for made in (drive, fresh))
    np.testing.assert_array_equal(result.control, expected.control)
    np.testing.assert_array_equal(drive.rate, fresh.rate)
    np.testing.assert_array_equal(told(drive), told(fresh))


def test_another_dt_converts_what_was_tuned_at_one():
    drive = controller(horizon=(4, 8), Qu=0.02, tuned_at_dt_s=0.1, offset_share=0.1)
    drive.step([0.0, 0.0], 0.05)
    drive.dt = 0.05
    assert drive.settings.at_step(drive.dt).steps == (8, 16)
    assert drive.Qu == pytest.approx(0.01)
    assert drive.step([0.0, 0.0], 0.05).predicted.shape == (2,)
    with pytest.raises(ValueError, match="dt"):
        drive.dt = 0.8
    assert (drive.dt, drive.Qu) == (0.05, pytest.approx(0.01))


def test_equal_bounds_freeze_a_control():
    drive = controller(
        straight, None, state=[0.0, 0.0], control=[0.0, 0.3], minimum=[-1, 0.3], maximum=[1, 0.3]
    )
    np.testing.assert_allclose(drive.Pu, np.diag([0.04, 0.01]))
    x = np.zeros(2)
    for _ in range(80):
        result = drive.step(x, [0.5, 0.5])
        assert result.control[1] == 0.3
        assert result.grown == ()
        assert "control 1" not in result.sentence
        assert result.status is not Status.REPAIRED
        x = np.array([x[0] + 0.1 * result.control[0], 0.5])
    assert x[0] == pytest.approx(0.5, abs=1e-3)
    drive.minimum, drive.maximum = [0.2, 0.3], [0.2, 0.3]
    np.testing.assert_array_equal(drive.step(x, [0.5, 0.5]).control, [0.2, 0.3])


COPIES = {
    "deep copy": copy.deepcopy,
    "copy": copy.copy,
    "pickle": lambda drive: pickle.loads(pickle.dumps(drive)),
}


@pytest.mark.parametrize("copied", COPIES.values(), ids=COPIES)
@pytest.mark.parametrize(
    "functions", [(cart, position), (jitted_cart, jitted_position)], ids=["plain", "jitted"]
)
def test_a_copy_goes_on_by_itself_from_the_same_step(copied, functions):
    drive = controller(*functions, offset_share=0.1, horizon=3, rate=3.0)
    for k in range(5):
        drive.step([0.1 * k, 0.0], 0.3)
    drive.maximum = 0.4
    other = copied(drive)
    for k in range(5):
        result, same = drive.step([0.1 * k, 0.0], 0.5), other.step([0.1 * k, 0.0], 0.5)
        np.testing.assert_array_equal(result.control, same.control)
        np.testing.assert_array_equal(result.covariance, same.covariance)
    np.testing.assert_array_equal(drive.step([0.0, 0.0], 0.7).control.shape, (1,))
    assert not np.array_equal(drive.Pu, other.Pu) or not np.array_equal(drive.control, other.control)


def test_an_explanation_tells_which_control_moves_which_output():
    """y = (u0, 0.1 u1) after 8 steps of 0.1 from (0, 0); deviations 0.4; the reference is (1, 0.1) away."""
    drive, fresh = (
        controller(
            lambda x, u, dt: x + dt * np.array([1.0, 0.1]) * u, None, control=[0.0, 1.0], P_err=[1e-4, 1.0], Pu=0.16
        )
        for _ in range(2)
    )  # fmt: skip
    found = drive.explain([0.0, 0.0], [1.0, 0.18])
    np.testing.assert_allclose(found.moves, [[0.32, 0.0], [0.0, 0.032]], atol=1e-12)
    np.testing.assert_allclose(found.distance, [1.0, 0.1], atol=1e-12)
    np.testing.assert_allclose(found.unit, [0.01, 1.0])
    np.testing.assert_array_equal(found.clipped, [0, 3])
    head, *rows = [line.split() for line in str(found).splitlines()[1:6]]
    assert head == ["control", "now", "minimum", "maximum", "deviation", "clipped", "->", "y0", "->", "y1"]
    assert rows[0][:7] == ["u0", "0", "-1", "1", "0.4", "0", "0.32"]
    assert [*rows[1][:6], rows[1][7]] == ["u1", "1", "-1", "1", "0.4", "3", "0.032"]
    assert rows[2:] == [["sqrt(P_err)", "0.01", "1"], ["reference", "-", "predicted", "1", "0.1"]]
    assert len({len(line) for line in str(found).splitlines()[1:6]}) == 1
    (hint,) = [hint for hint in found.hints if "P_err" in hint]
    assert re.search(r"y1 is 31\.[23] times", hint)
    after, expected = (made.step([0.0, 0.0], [1.0, 0.0]) for made in (drive, fresh))
    np.testing.assert_array_equal(after.control, expected.control)


ADVICE = {
    "short": ({"horizon": 1}, [0.0, 0.0], [("y0", "longer horizon"), ("u0", "nominal")]),
    "frozen": (
        {"plant": straight, "output": None, "control": [0.0, 0.3], "minimum": [-1, 0.3], "maximum": [1, 0.3]},
        [0.0, 0.0],
        [("y1", "longer horizon"), ("u1", "frozen")],
    ),
    "diverging": (
        {"plant": lambda x, u, dt: x + dt * (u + x**3), "output": None, "control": [0.0, 0.0], "horizon": 30},
        [1e3, 1e3],
        [("5 sigma points", "shorter horizon")],
    ),
}


def test_advice_counts_from_a_thousandth_of_P_err_and_from_one_point_that_is_left():
    found = controller(straight, None, control=[0.0, 0.0]).explain([0.0, 0.0], [1.0, 1.0])
    moves = np.array([[2.0, 2.0], [2e-3, 2e-3]])
    for_points, for_control = replace(found, moves=moves, unit=np.full(2, 2.0), diverged=4).hints
    assert "4 sigma points" in for_points
    assert "u1" in for_control


@pytest.mark.parametrize("case", ADVICE)
@pytest.mark.filterwarnings("ignore")
def test_an_explanation_advises(case):
    changes, state, expected = ADVICE[case]
    drive = controller(**changes)
    hints = drive.explain(state, np.ones(len(drive.plant.output_names))).hints
    assert len(hints) == len(expected)
    for hint, words in zip(hints, expected, strict=True):
        assert all(word in hint for word in words)
