# SPDX-License-Identifier: Apache-2.0
"""Steps that have no answer as the paper's equations stand, and how UTC comes out of them."""

import itertools

import numba
import numpy as np
import paper_utc
import pytest
from carts import assert_usable, controller, straight
from skydivers import parts_of

from skydiver_utc import Status
from skydiver_utc.controllers.utc.law import Recovery
from skydiver_utc.controllers.utc.survivors import next_spread, survived_range, weights_left
from skydiver_utc.parameters import load_scenario

FREE = {"minimum": -np.inf, "maximum": np.inf}
TURN = "fast_turn_unknown_dynamics"


def test_a_recovery_keeps_its_number_in_recordings():
    assert [*Recovery] == [0, 1, 2, 3]


def bent(**changes):
    """y = u + u^2."""
    given = {"state": [0.0], "horizon": 1, "P_err": 0.5, "W0": -3.0} | FREE
    return controller(lambda x, u, dt: u + u**2, None, **(given | changes))


def test_a_negative_central_weight_that_makes_C_y_indefinite():
    """W0 = -3, Pu = 4: points 0, 1, -1 with outputs 0, 2, 0. About the mean C_y < 0; about the centre it is not.

    Mean 4, C_y = P_err - 3 (0 - 4)^2 + 2 ((2 - 4)^2 + (0 - 4)^2) = P_err - 8. About the centre
    C_y = P_err + 2 x 2^2 = 8.5, C_uy = 2 x 1 x 2 = 4, and Pu = Qu + 2 (1 + 1) - 4^2 / 8.5.
    """
    result = bent(Pu=4.0, Qu=0.1).step([0.0], 5.0)
    assert (result.status, result.recovery) == (Status.REPAIRED, Recovery.ABOUT_CENTRE)
    np.testing.assert_allclose(result.predicted, [4.0], rtol=1e-12)
    np.testing.assert_allclose(result.control, [4.0 / 8.5 * (5.0 - 4.0)], rtol=1e-12)
    np.testing.assert_allclose(result.covariance, [[0.1 + 4.0 - 16.0 / 8.5]], rtol=1e-12)
    assert "central point" in result.sentence
    small = bent(Pu=0.04, Qu=0.0).step([0.0], 0.1)
    assert (small.status, small.recovery) == (Status.SOLVED, Recovery.NONE)


def test_an_indefinite_covariance_is_repaired_and_reported():
    """Eigenvalues of [[1, 2], [2, 1]] are 3 and -1: the repair adds 1, and the floor."""
    drive = controller(straight, None, control=[0.0, 0.0], minimum=-9, maximum=9, Pu=[[1.0, 2.0], [2.0, 1.0]])
    result = drive.step([0.0, 0.0], [0.1, 0.1])
    assert result.status is Status.REPAIRED
    assert result.repaired == pytest.approx(1.0, rel=1e-6)
    assert "lifted by 1" in result.sentence
    assert_usable(result, -9.0, 9.0)
    flat = controller(straight, None, control=[0.0, 0.0], minimum=-9, maximum=9, Pu=np.full((2, 2), 4e-6))
    result = flat.step([0.0, 0.0], [0.1, 0.1])
    assert result.repaired == pytest.approx(1e-9 * 4e-6, rel=1e-5)
    assert "lifted by 4e-15" in result.sentence


def test_outputs_whose_covariance_rounding_makes_indefinite():
    """y = 1e8 (1, 2, 3) u with P_err = 1e-4: C_y has eigenvalues of about 1e16 and 1e-4, 20 digits apart.

    u moves to the reference. A step in which the rounding leaves C_y definite by chance needs nothing.
    """
    slopes = 1e8 * np.array([1.0, 2.0, 3.0])
    drive = controller(
        lambda x, u, dt: slopes * u, None, state=np.zeros(3), horizon=1, P_err=1e-4, Pu=0.04, Qu=0.004, **FREE
    )
    found = []
    for wanted in (0.1, -0.2, 0.3, 0.35, -0.4):
        result = drive.step(np.zeros(3), slopes * wanted)
        found.append(result.recovery)
        repaired = result.recovery is Recovery.OUTPUTS_REPAIRED
        assert (result.status is Status.REPAIRED) is ("rounding" in result.sentence) is repaired
        np.testing.assert_allclose(result.control, [wanted], rtol=1e-9)
        np.testing.assert_allclose(result.covariance, [[0.004]], rtol=1e-6)
    assert Recovery.OUTPUTS_REPAIRED in found
    assert set(found) <= {Recovery.NONE, Recovery.OUTPUTS_REPAIRED}


def test_a_central_weight_of_zero_is_not_negative():
    """y = 1e8 (u + u^2, u - u^2) at -1, 0, 1: all on one line about the mean, not about the central point."""
    drive = controller(
        lambda x, u, dt: 1e8 * (u + u**2 * [1.0, -1.0]), None, horizon=1, P_err=1e-4, Pu=1.0, W0=0.0
    )
    assert drive.step([0.0, 0.0], [0.0, 0.0]).recovery is Recovery.OUTPUTS_REPAIRED


def linear_without(lost, B, u0, **changes):
    """UTC of y = B u of which some sigma points have no output; one step of one horizon step may be taken."""
    points = itertools.count(-1)  # the plant is tried once before

    def plant(x, u, dt):
        return np.full(len(B), np.nan) if next(points) in lost else B @ u

    return controller(plant, None, state=np.zeros(len(B)), control=u0, horizon=1, **FREE, **changes)


@pytest.mark.parametrize(
    ("lost", "innovation"), [([3], "mean"), ([0, 2], "mean"), ([1, 2, 3, 4], "mean"), ([0, 2], "control")]
)
def test_a_point_that_diverges_counts_no_more(lost, innovation):
    """The update is eq:xpred to eq:utc_controller over the other points, their weights scaled to sum to one."""
    rng = np.random.default_rng(8)
    factor, u0, B, r = (
        rng.normal(size=(3, 3)),
        rng.normal(size=3),
        rng.normal(size=(2, 3)),
        rng.normal(size=2),
    )
    Pu, Qu, R = factor @ factor.T + 0.1 * np.eye(3), 0.3 * np.eye(3), np.diag([0.1, 0.2])
    result = linear_without(lost, B, u0, P_err=R, Pu=Pu, Qu=Qu, innovation=innovation).step(np.zeros(2), r)
    left = np.delete(paper_utc.sigma_points(u0, Pu, 0.25), lost, axis=0)
    W = np.delete(paper_utc.weights(3, 0.25), lost)
    W = W / W.sum()
    expected = paper_utc.update(*paper_utc.predict(left, W, Qu), left, left @ B.T, W, r, R)
    np.testing.assert_allclose(result.control, expected.U, rtol=1e-10)
    np.testing.assert_allclose(result.covariance, expected.Pu, rtol=1e-9, atol=1e-10)
    assert (result.status, result.lost) == (Status.REPAIRED, len(lost))
    assert f"{len(lost)} of 7 sigma points diverged" in result.sentence
    assert "lifted" not in result.sentence
    assert ("drawn" in result.sentence) is (result.spread < 1.0)


@pytest.mark.parametrize("lost", [(1,), (0,), (1, 4), (1, 2, 3, 4)])
@pytest.mark.parametrize("W0", [-3.0, -2.9])
def test_what_is_left_beside_a_negative_central_weight_weighs_the_same(W0, lost):
    """Two controls, W0 = -3: each other point weighs 1, so that without one of them nothing would be left.

    y = 2 u0 - u1 of Pu = I; moments of the remaining points under equal weights, by NumPy.
    """
    B, Qu, u0 = np.array([[2.0, -1.0]]), 0.1 * np.eye(2), np.array([0.3, 0.2])
    result = linear_without(lost, B, u0, P_err=0.5, Pu=1.0, Qu=Qu, W0=W0).step([0.0], 1.0)
    points = u0 + np.sqrt(2.0 / (1.0 - W0)) * np.vstack([np.zeros(2), np.eye(2), -np.eye(2)])
    points = np.delete(points, lost, axis=0)
    mean, Pu = points.mean(axis=0), np.atleast_2d(np.cov(points.T, bias=True))
    gain = Pu @ B.T @ np.linalg.inv(B @ Pu @ B.T + 0.5)
    np.testing.assert_allclose(result.control, mean + gain @ (1.0 - B @ mean), rtol=1e-12)
    np.testing.assert_allclose(result.covariance, Qu + Pu - gain @ B @ Pu, rtol=1e-11, atol=1e-14)
    assert (result.status, result.recovery, result.lost) == (Status.REPAIRED, Recovery.NONE, len(lost))


def test_where_the_centre_is_lost_after_other_points_the_rest_shows_the_way():
    """Moments of the four points beside it, by NumPy; the control stays among them."""
    B = np.array([[2.0, -1.0]])
    drive = linear_without((1, 3, 5), B, np.array([5.0, 3.0]), P_err=0.5, Pu=1.0, Qu=0.1)
    assert drive.step([0.0], 7.0).spread == 0.5
    result = drive.step([0.0], 7.0)
    points = result.sigma_points[1:]
    mean, Pu = points.mean(axis=0), np.cov(points.T, bias=True)
    expected = mean + Pu @ B.T @ np.linalg.inv(B @ Pu @ B.T + 0.5) @ (7.0 - B @ mean)
    np.testing.assert_allclose(result.control, np.clip(expected, points.min(axis=0), points.max(axis=0)))
    assert (result.spread, result.lost) == (0.5, 1)


def escape(x, u, dt):
    """x' = x^3 + u: escapes to infinity in finite time from where u cannot hold it."""
    return x + dt * (x**3 + u)


def overflowing(x, u, dt):
    """The same through plain floats, which raise OverflowError instead of going to infinity."""
    value = float(x[0])
    return np.array([value + dt * (value**3 + float(u[0]))])


@pytest.mark.parametrize(
    "plant", [escape, numba.njit(escape), overflowing], ids=["numpy", "jitted", "floats"]
)
def test_an_escaping_plant_is_caught_by_the_points_that_are_left(plant):
    """At x = 1.3 only controls around -2 survive 20 steps; the controller finds them and then holds the plant."""
    drive = controller(plant, None, state=[0.0], dt=0.05, horizon=20, minimum=-8, maximum=8, Pu=9.0)
    x, lost = np.array([1.3]), 0
    for _ in range(200):
        result = drive.step(x, 0.0)
        assert_usable(result, -8.0, 8.0)
        if result.lost:
            lost += 1
            assert result.status in (Status.REPAIRED, Status.KEPT_PREVIOUS)
            assert "diverged" in result.sentence
        x = escape(x, result.control, 0.05)
    assert lost > 0
    assert abs(x[0]) < 1e-3


def test_after_a_step_without_an_answer_the_next_begins_from_the_initial_covariance():
    """A covariance that grew, then a state from where everything diverges; NaN as a state changes nothing."""
    drive = controller(
        lambda x, u, dt: x + dt * (x**3 + 0.0 * u), None, state=[0.0], control=0.5, horizon=10, Pu=2.0, Qu=3.0, **FREE
    )  # fmt: skip
    drive.step([0.0], 0.0)
    np.testing.assert_allclose(drive.Pu, [[5.0]])
    result = drive.step([1e3], 0.0)
    assert_usable(result, -np.inf, np.inf)
    assert (result.status, result.recovery, result.lost) == (Status.KEPT_PREVIOUS, Recovery.RESTARTED, 3)
    assert "3 of 3 sigma points diverged" in result.sentence
    np.testing.assert_allclose([result.control, result.innovation], [[0.5], [0.0]])
    np.testing.assert_allclose(result.covariance, [[2.0]])
    assert drive.step([0.0], 0.0).status is not Status.KEPT_PREVIOUS
    np.testing.assert_allclose(drive.Pu, [[5.0]])


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("where", ["state", "reference"])
def test_a_state_or_reference_that_is_not_finite_keeps_control_and_covariance(where, bad):
    drive = controller()
    arguments = ([0.0, bad], 0.02) if where == "state" else ([0.0, 0.0], bad)
    first = drive.step(*arguments)
    np.testing.assert_array_equal([first.control, first.predicted, first.innovation], np.zeros((3, 1)))
    before = drive.step([0.0, 0.0], 0.02)
    result = drive.step(*arguments)
    assert_usable(result)
    assert (result.status, result.recovery) == (Status.KEPT_PREVIOUS, Recovery.NONE)
    assert (result.repaired, result.lost) == (0.0, 0)
    assert "not finite" in result.sentence
    np.testing.assert_array_equal(result.control, before.control)
    np.testing.assert_array_equal(result.covariance, before.covariance)
    assert drive.step([0.0, 0.0], 0.02).status is Status.SOLVED


@pytest.mark.parametrize(("row", "kept"), [(20, True), (21, False)])
def test_the_reference_must_be_finite_up_to_the_horizon(row, kept):
    plant, _, controller = parts_of(load_scenario(TURN))
    preview = np.ones((controller.preview_steps + 1, 1))
    preview[row] = np.nan
    decision = controller.decide(plant.initial_state(), preview)
    assert (decision.status is Status.KEPT_PREVIOUS) is kept
    assert decision.telemetry[controller.telemetry_names.index("recovery")] == Recovery.NONE


@pytest.mark.parametrize(
    ("W0", "alive", "left"),
    [
        (0.2, [1, 1, 1, 1, 1], [0.2, 0.2, 0.2, 0.2, 0.2]),
        (0.6, [1, 1, 0, 1, 1], [2 / 3, 1 / 9, 0, 1 / 9, 1 / 9]),
        (0.0, [1, 1, 0, 1, 1], [0, 1 / 3, 0, 1 / 3, 1 / 3]),
        (-1.0, [1, 1, 1, 1, 1], [-1.0, 0.5, 0.5, 0.5, 0.5]),
        (-1.0, [1, 1, 0, 1, 1], [0.25, 0.25, 0, 0.25, 0.25]),
        (0.0, [1, 0, 0, 0, 0], [1, 0, 0, 0, 0]),
        (0.5, [0, 0, 0, 0, 0], [0, 0, 0, 0, 0]),
    ],
)
@pytest.mark.parametrize("where", ["outputs", "saved"])
def test_the_weights_of_the_points_that_are_left_have_the_same_sum(W0, alive, left, where):
    weights = np.array([W0, *np.full(4, (1.0 - W0) / 4.0)])
    given = {"outputs": np.ones((5, 2)), "saved": np.ones((5, 3))}
    for wrong in (np.nan, np.inf, 2e100):
        given[where][:, -1] = np.where(alive, -1e100, wrong)
        found, survived = np.empty((2, 5))
        lost = weights_left(weights, given["outputs"], given["saved"], found, survived)
        assert lost == alive.count(0)
        np.testing.assert_array_equal(survived, alive)
        np.testing.assert_allclose(found, left, rtol=1e-12)
        for array in given.values():
            assert not array[np.array(alive) == 0].any()


@pytest.mark.parametrize(
    ("now", "alive", "following"),
    [
        (0.4, [1, 1, 1, 1, 1], 0.44),
        (0.95, [1, 1, 1, 1, 1], 1.0),
        (0.4, [0, 0, 0, 0, 0], 1.0),
        (1.0, [1, 0, 1, 1, 0], 1.0),
        (1.0, [1, 0, 1, 0, 1], 0.5),
        (1.0, [1, 1, 0, 1, 0], 0.5),
        (0.5, [1, 0, 1, 1, 1], 0.25),
        (0.5, [0, 0, 1, 0, 1], 0.5),
        (1.5e-6, [1, 0, 0, 0, 0], 1e-6),
    ],
)
def test_the_spread_of_the_next_points_follows_from_those_that_survive(now, alive, following):
    assert next_spread(now, np.array(alive, dtype=float), alive.count(0)) == pytest.approx(following)


def test_the_range_of_a_control_is_that_of_the_points_that_survive():
    saved = np.array([[0.0, 9.0], [0.5, 9.0], [-0.5, 9.0], [0.2, 9.0], [-3.0, 9.0]])
    alive = np.array([1.0, 1.0, 1.0, 1.0, 0.0])
    assert survived_range(saved, alive, 0, -1.0, 1.0) == (-0.5, 0.5)
    assert survived_range(saved, alive, 0, -0.1, 0.3) == (-0.1, 0.3)


def test_the_skydiver_begins_again_with_the_signs_of_the_present_turn():
    """A state that everything diverges from, in a right turn; the first decision was in a left one."""
    scenario = load_scenario(TURN)
    (plant, _, tried), (*_, fresh) = (parts_of(scenario) for _ in range(2))
    state = plant.initial_state()
    left = np.linspace([1.0], [2.0], tried.preview_steps + 1)
    tried.decide(state, left)
    lost = state.copy()
    lost[10:] = 1e90
    decision = tried.decide(lost, -left)
    assert decision.status is Status.KEPT_PREVIOUS
    assert decision.telemetry[tried.telemetry_names.index("recovery")] == Recovery.RESTARTED
    fresh.resume(decision.control)
    np.testing.assert_array_equal(tried.decide(state, -left).control, fresh.decide(state, -left).control)
