# SPDX-License-Identifier: Apache-2.0
"""UTC on plants of functions, against independent transcriptions of the law and against what users do to it."""

import os
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import plain_utc
import pytest
from carts import assert_usable, cart, controller, straight
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.linalg import block_diag

from skydiver_utc import FunctionPlant, Status, UnscentedTransformController, UtcSettings

DT, ROOT = 0.05, Path(__file__).parents[2]


def random_plant(rng, n, m, outputs):
    """A stable nonlinear plant x + dt (A tanh(x) - x + B sin(u) + x0 u0 / 5), and a nonlinear output map of it."""
    A, B, C = rng.normal(size=(n, n)), rng.normal(size=(n, m)), rng.normal(size=(outputs, n))

    def plant(x, u, dt):
        following = np.empty_like(x)
        for i in range(n):
            change = 0.2 * x[0] * u[0] - x[i]
            for j in range(n):
                change += A[i, j] * np.tanh(x[j])
            for j in range(m):
                change += B[i, j] * np.sin(u[j])
            following[i] = x[i] + dt * change
        return following

    def output(x):
        y = np.zeros(outputs)
        for i in range(outputs):
            for j in range(n):
                y[i] += C[i, j] * (x[j] + 0.1 * x[j] ** 2)
        return y

    return plant, output


def lagged(point, control, state, preview, j):
    """An actuator that follows the point with a lag, and leans on state and reference."""
    return control + 0.3 * (point - control) + 0.01 * (preview[j + 1, 0] - state[0])


def beside_the_oracle(
    seed, n, m, outputs, steps, *, bounded, dynamics, jitted=False, W0=0.25, nominal=(), count=12
):
    """What the controller and the oracle, each with its own U and Pu, make of the same plant over some steps.

    Also counts the steps that would have gone another way without limits.
    """
    rng = np.random.default_rng(seed)
    plant, output = random_plant(rng, n, m, outputs)
    factor = rng.normal(size=(m, m))
    Pu = 0.05 * (factor @ factor.T + 0.3 * np.eye(m))
    P_err = np.diag(rng.uniform(0.01, 0.1, outputs))
    x, U = rng.normal(size=n), rng.uniform(-0.05, 0.05, m)
    low, high, rate = np.full(m, -np.inf), np.full(m, np.inf), np.full(m, np.inf)
    if bounded:
        low, high, rate = np.full(m, -0.1), np.full(m, 0.08), rng.uniform(2.0, 20.0, m)
        U[0] = low[0]
    values, variances = rng.uniform(-0.05, 0.05, m), rng.uniform(0.01, 0.1, m)
    tried = UnscentedTransformController.of(
        *(numba.njit(f) if jitted else f for f in (plant, output)),
        state=x, control=U, dt=DT, horizon=steps, minimum=low, maximum=high, rate=rate,
        P_err=P_err, W0=W0, Pu=Pu, Qu_ratio=0.2, covariance_floor=1e-9, dynamics=lagged if dynamics else None,
        nominal={f"u{c}": {"value": values[c], "variance": variances[c]} for c in nominal},
    )  # fmt: skip
    problem = plain_utc.Problem(
        plant, output, DT, tuple(steps), low, high, rate * DT,
        block_diag(*[P_err] * len(steps), *variances[list(nominal)]), W0, 1e-9, lagged if dynamics else None,
        nominal, tuple(values[list(nominal)]),
    )  # fmt: skip
    no_limit = np.full(m, np.inf)
    unbounded = problem._replace(low=-no_limit, high=no_limit, largest_change=no_limit)
    preview = rng.normal(size=(count + steps[-1] + 1, outputs))
    got, expected, limited, oracle_Pu = [], [], 0, Pu
    for k in range(count):
        window = preview[k : k + steps[-1] + 1]
        result = tried.step(x, window)
        free_U, *_ = plain_utc.step(U, oracle_Pu, x, window, 0.2 * Pu, unbounded)
        U, oracle_Pu, predicted = plain_utc.step(U, oracle_Pu, x, window, 0.2 * Pu, problem)
        got.append(np.concatenate([result.control, result.covariance.ravel(), result.predicted]))
        of_plant = len(predicted) - len(nominal)
        expected.append(np.concatenate([U, oracle_Pu.ravel(), predicted[:of_plant]]))
        limited += int(np.abs(free_U - U).max() > 1e-6)
        x = plant(x, result.control, DT)
    return np.array(got), np.array(expected), limited


@pytest.mark.parametrize("dynamics", [False, True], ids=["held", "own dynamics"])
@pytest.mark.parametrize("bounded", [False, True], ids=["free", "bounded"])
@pytest.mark.parametrize("seed", range(8))
def test_it_agrees_with_textbook_utc_on_random_plants(seed, bounded, dynamics):
    """Twelve closed-loop steps to 1e-10, relative to the size of the numbers (about 1) and absolute."""
    rng = np.random.default_rng(100 + seed)
    n, m, outputs = (int(rng.integers(low, high)) for low, high in ((1, 7), (1, 6), (1, 5)))
    steps = sorted({int(step) for step in rng.integers(1, 15, size=1 + seed % 2)})
    W0 = rng.uniform(-0.5, 0.6)
    got, expected, limited = beside_the_oracle(
        seed, n, m, outputs, steps, bounded=bounded, dynamics=dynamics, W0=W0
    )
    np.testing.assert_allclose(got, expected, rtol=1e-10, atol=1e-10)
    assert (limited > 0) is bounded


@pytest.mark.parametrize("jitted", [False, True], ids=["plain", "jitted"])
@pytest.mark.parametrize("nominal", [(), (0, 2)], ids=["", "nominal controls"])
@pytest.mark.parametrize(("bounded", "dynamics"), [(False, False), (True, True)])
def test_jitted_plants_and_nominal_controls_agree_with_it_too(bounded, dynamics, nominal, jitted):
    """Two of three controls as outputs of their own, beside two outputs of the plant at two steps."""
    got, expected, _ = beside_the_oracle(
        6, 4, 3, 2, [4, 9], bounded=bounded, dynamics=dynamics, jitted=jitted, nominal=nominal
    )
    np.testing.assert_allclose(got, expected, rtol=1e-10, atol=1e-10)


def test_a_direction_that_no_output_sees_settles_at_Qu_over_the_forgetting_factor():
    """One output u0 + u1: the variance of u0 - u1 obeys v = (1 - f) (v + q), so v = q (1 - f) / f."""
    f, q = 0.2, 0.3
    tried = summing(Pu=1.0, Qu=q, forgetting_factor=f)
    for _ in range(200):
        Pu = tried.step([0.0], 0.0).covariance
    unseen = np.array([1.0, -1.0]) / np.sqrt(2.0)
    assert unseen @ Pu @ unseen == pytest.approx(q * (1.0 - f) / f, rel=1e-6)


def summing(**changes):
    """y = u0 + u1."""
    return controller(
        lambda x, u, dt: np.array([u[0] + u[1]]), None, state=[0.0], control=[0.0, 0.0], horizon=1,
        minimum=-np.inf, maximum=np.inf, **changes,
    )  # fmt: skip


@pytest.mark.parametrize("innovation", ["mean", "control"])
def test_a_control_that_no_output_sees_goes_to_its_nominal_value(innovation):
    """y = u0 + u1 wanted at 1 and u1 at 0.2: u = (0.8, 0.2), which leaves no error at all."""
    nominal = {"u1": {"value": 0.2, "variance": 0.5}}
    tried = summing(P_err=1e-3, Pu=1.0, Qu=0.1, nominal=nominal, innovation=innovation)
    for _ in range(300):
        result = tried.step([0.0], 1.0)
    np.testing.assert_allclose(result.control, [0.8, 0.2], atol=1e-6)
    assert result.predicted.shape == result.innovation.shape == (1,)


def test_decide_is_step_in_the_slot_of_a_controller():
    plant = FunctionPlant(cart, state=[0.0, 0.0], control=0.0, dt=0.1, minimum=-1.0, maximum=1.0)
    law = UtcSettings(horizon_steps=8)
    slot, library = (UnscentedTransformController(law, plant, ("x0", "x1")[:0], 0.1, 0) for _ in range(2))
    preview = np.linspace([0.0, 0.0], [0.5, 0.1], slot.preview_steps + 1)
    for place in (0.0, 0.1, np.nan, 0.3):
        decision, result = slot.decide(np.array([place, 0.0]), preview), library.step([place, 0.0], preview)
        np.testing.assert_array_equal(decision.control, result.control)
        assert decision.status is result.status
        told = [*result.predicted, *result.innovation, *result.deviations]
        told += [result.repaired, result.recovery, result.lost]
        np.testing.assert_array_equal(decision.telemetry, told)
        assert len(told) == len(slot.telemetry_names)


def test_what_is_handed_out_is_a_copy():
    drive = controller()
    result = drive.step([0.0, 0.0], 0.01)
    kept = drive.control
    for handed_out in (result.control, result.covariance, result.predicted, drive.Pu, drive.control):
        handed_out[:] = np.nan
    np.testing.assert_array_equal(drive.control, kept)
    assert_usable(drive.step([0.0, 0.0], 0.01))


def test_the_rate_limit_counts_per_unit_of_time():
    result = controller(rate=2.0).step([0.0, 0.0], 100.0)
    np.testing.assert_allclose(result.control, [0.2])
    assert result.status is Status.SATURATED
    assert "control 0" in result.sentence
    assert "rate limit" in result.sentence
    for reference, bound in ((100.0, "maximum 1"), (-100.0, "minimum -1")):
        assert f"control 0 is on its {bound}" in controller().step([0.0, 0.0], reference).sentence
        assert "rate limit" in controller(rate=2.0).step([0.0, 0.0], reference).sentence


def test_controls_of_different_units_need_no_repair():
    """A rocket of 1000 kg, thrust up to 20000 N, gimbal to 0.1 rad: variances 4e6 and 4e-4."""

    def rocket(x, u, dt):
        return x + dt * np.array([u[0] / 1000.0 * np.cos(u[1]) - 9.81, u[0] / 1000.0 * np.sin(u[1])])

    limits = {"minimum": np.array([0.0, -0.1]), "maximum": np.array([20000.0, 0.1])}
    drive = controller(rocket, None, control=[9810.0, 0.0], Pu=(4e6, 4e-4), **limits)
    x = np.zeros(2)
    for _ in range(60):
        result = drive.step(x, [1.0, 0.2])
        assert result.status in (Status.SOLVED, Status.SATURATED)
        x = rocket(x, result.control, 0.1)
    np.testing.assert_allclose(x, [1.0, 0.2], atol=1e-2)


anything = st.floats(allow_nan=True, allow_infinity=True)


@settings(max_examples=100, deadline=None)
@given(
    states=st.lists(arrays(float, 2, elements=anything), min_size=1, max_size=6),
    reference=anything,
    factor=arrays(float, (2, 2), elements=st.floats(-1e6, 1e6)),
    W0=st.floats(-9.9, 0.99),
    variance=st.floats(1e-12, 1e12),
)
def test_whatever_arrives_the_control_is_finite_and_in_bounds(states, reference, factor, W0, variance):
    """Any state, any reference, any covariance that can be given, on a plant that can diverge."""

    def plant(x, u, dt):
        return x + dt * (x**3 + np.array([u[0] * x[1], u[1]]))

    symmetric = factor + factor.T
    np.fill_diagonal(symmetric, np.abs(np.diag(symmetric)) + 1e-9)
    drive = controller(
        plant, None, control=[0.0, 0.0], horizon=5, minimum=[-1, -2], maximum=[3, 4],
        Pu=symmetric, Qu=symmetric, P_err=variance, W0=W0,
    )  # fmt: skip
    for state in states:
        assert_usable(drive.step(state, [reference, 0.0]), np.array([-1, -2]), np.array([3, 4]))


WRONG = [
    ({"dt": 0.0}, "dt"), ({"dt": np.nan}, "dt"), ({"dt": "fast"}, "dt"),
    ({"horizon": 0}, "horizon"), ({"horizon": 2.5}, "horizon"), ({"horizon": []}, "horizon"),
    ({"horizon": [5, 3]}, "horizon.*rising"), ({"horizon": "8"}, "horizon"), ({"horizon": None}, "horizon"),
    ({"W0": 1.0}, "W0"), ({"minimum": 2.0}, "minimum"), ({"minimum": [-1.0, -1.0]}, "minimum"),
    ({"maximum": np.nan}, "maximum"), ({"control": 5.0}, "control"), ({"control": [[0.0]]}, "control"),
    ({"rate": 0.0}, "rate"), ({"state": [0.0, np.inf]}, "state"), ({"state": [0.0, 1j]}, "state"),
    ({"state": [[0.0], [1.0, 2.0]]}, "state"), ({"P_err": -1.0}, "P_err"), ({"P_err": 0.0}, "P_err"),
    ({"P_err": [1.0, 1.0]}, "P_err"), ({"P_err": "x"}, "P_err"), ({"Pu": np.nan}, "Pu"), ({"Pu": 0.0}, "Pu"),
    ({"Pu": [1.0, 1.0]}, "Pu"), ({"Qu": -1.0}, "Qu"), ({"Qu": [[1.0, 0.5], [0.2, 1.0]]}, "Qu"),
    ({"Pu": [[1.0, 0.0], [0.0, 1.0]]}, r"Pu has shape \(2, 2\)"), ({"Pu": {"u7": 1.0}}, "Pu names u7"),
    ({"Pu": {"u0": 1.0, "u7": 1.0}}, "Pu names u0, u7"), ({"after_reference": {"u0": 9.0}}, r"after_reference\.u0"),
    ({"control": [0.0, 0.0], "Pu": [[1.0, 0.5], [0.45, 1.0]]}, "Pu is not symmetric"),
    ({"minimum": -np.inf}, "Pu is needed"), ({"rest": 0.0}, "rest"), ({"angles": ("heading",)}, "angles.*heading"),
    ({"nominal": {"u7": {"value": 0.0, "variance": 1.0}}}, r"nominal\.u7"),
    ({"nominal": {"u0": {"value": 9.0, "variance": 1.0}}}, r"nominal\.u0"),
    ({"nominal": {"u0": {"value": 0.0, "variance": 0.0}}}, "variance"),
    ({"control": 0.5, "minimum": 0.1, "nominal": {"u0": {"variance": 1.0}}}, r"nominal\.u0"),
    ({"after_reference": {"alpha": 0.0}}, r"after_reference\.alpha"),
    ({"dynamics": 3}, "dynamics"), ({"coupling": {"k_right": 1.0, "k_left": 1.0, "alpha": 1.0}}, "coupling"),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "named"), WRONG, ids=str)
def test_what_cannot_be_used_is_named_in_one_sentence(changes, named):
    with pytest.raises(ValueError, match=named) as raised:
        controller(**changes)
    assert "\n" not in str(raised.value)


def test_dynamics_of_a_control_that_the_plant_lacks_are_named():
    law = UtcSettings(horizon_steps=8, dynamics={"control": "u7"})
    with pytest.raises(ValueError, match=r"dynamics\.control.*u7"):
        UnscentedTransformController(law, controller().plant)


def test_a_covariance_may_miss_its_symmetry_by_rounding():
    Pu = [[1e3, 1e-10], [0.0, 1e3]]
    np.testing.assert_array_equal(controller(straight, None, control=[0.0, 0.0], Pu=Pu).Pu, Pu)


def test_what_is_not_given_follows_from_the_ranges_and_the_outputs():
    """Pu: a tenth of each range, squared; P_err: a tenth, squared, of the deviation that Pu gives the output."""
    np.testing.assert_allclose(
        controller(straight, None, control=[0.0, 0.0], minimum=[-0.1, 0.0], maximum=[0.1, 3.0]).Pu,
        np.diag([0.02**2, 0.3**2]),
    )
    given = {"state": [0.0], "horizon": 1, "Pu": 0.04}
    for output in (lambda x: x, lambda x: x + 3.0):
        of_two = controller(
            lambda x, u, dt: np.array([u[0] + 0.5 * u[1]]), output, control=[0.0, 0.0], **given
        )
        np.testing.assert_allclose(of_two.P_err, [[0.01 * 0.04 * 1.25]])
    np.testing.assert_allclose(
        controller(lambda x, u, dt: u + u**2, None, **given).P_err, [[4e-4]], rtol=1e-5
    )
    # No slope at the start: from points at a hundredth of sqrt(4/3), with weights of 3/8.
    square = controller(lambda x, u, dt: u**2, None, **(given | {"Pu": 1.0}))
    np.testing.assert_allclose(square.P_err, [[0.01 * 0.75 * (0.01 * 4.0 / 3.0) ** 2]])
    # Nothing moves there: from points at 1.
    given |= {"Pu": 0.75, "minimum": -9.0, "maximum": 9.0}
    dead_band = controller(lambda x, u, dt: np.maximum(np.abs(u) - 0.5, 0.0), None, **given)
    np.testing.assert_allclose(dead_band.P_err, [[0.01 * 0.75 * 0.5**2]])
    assert np.isnan(controller(output=lambda x: 3.0).P_err).all()


def test_the_tangent_is_the_present_value_and_its_change():
    def plant(x, u, dt):
        return x + dt * u

    made = [
        controller(plant, None, control=[0.0, 0.0], horizon=(2, 5), P_err=0.1, aim=aim)
        for aim in ("tangent", "end_point")
    ]
    preview = np.random.default_rng(3).normal(size=(6, 2))
    continued = preview[0] + np.arange(6)[:, np.newaxis] * (preview[1] - preview[0])
    tangent, end_point = (
        drive.step([0.0, 0.0], rows) for drive, rows in zip(made, (preview, continued), strict=True)
    )
    np.testing.assert_allclose(tangent.control, end_point.control, rtol=1e-12)
    np.testing.assert_allclose(tangent.innovation, end_point.innovation, rtol=1e-12)


def test_angles_of_several_steps_are_the_same_a_turn_further():
    made = [controller(horizon=(2, 4), P_err=0.1, angles=("y0",)) for _ in range(2)]
    near, far = (
        drive.step([turns * 2.0 * np.pi, 0.0], 0.01) for drive, turns in zip(made, (0, 3), strict=True)
    )
    further = made[1].explain([6.0 * np.pi, 0.0], 0.01)
    np.testing.assert_allclose(further.distance, made[0].explain([0.0, 0.0], 0.01).distance, atol=1e-9)
    np.testing.assert_allclose(far.innovation, near.innovation, atol=1e-9)
    np.testing.assert_allclose(far.control, near.control, atol=1e-9)


def test_compared_with_its_own_output_a_control_answers_for_the_mean_of_points_at_bounds():
    """K a = change of the mean, in least squares with weights 1 / Pu: a = (K' W K)^-1 K' W change."""
    B = np.array([[1.0, 0.4, -0.3], [0.2, -0.8, 0.5]])
    variances = np.array([0.04, 0.09, 0.01])
    drive = controller(
        lambda x, u, dt: B @ u, None, control=[0.0, 0.0, 0.0], horizon=1, Pu=variances, P_err=[0.01, 0.4],
        minimum=[-0.05, -9.0, -0.01], maximum=9.0, innovation="control",
    )  # fmt: skip
    wanted = np.array([0.05, -0.1])
    result = drive.step([0.0, 0.0], wanted)
    mean = np.array([0.25, *np.full(6, 0.125)]) @ result.sigma_points
    K = result.gain
    weighted = K.T / variances
    answer = np.linalg.solve(weighted @ K, weighted @ mean)
    np.testing.assert_allclose(result.control, mean + K @ (wanted - answer), rtol=1e-9)
    np.testing.assert_allclose(result.innovation, wanted - answer, rtol=1e-9)


def test_with_more_outputs_than_controls_the_answer_takes_all_of_the_mean_back():
    drive = controller(
        lambda x, u, dt: u * [1.0, 0.4], None, horizon=1, Pu=0.04, P_err=[0.01, 0.4], minimum=-0.05,
        innovation="control",
    )  # fmt: skip
    result = drive.step([0.0, 0.0], [0.05, -0.1])
    np.testing.assert_allclose(result.control, result.gain @ [0.05, -0.1], rtol=1e-9)


@pytest.mark.parametrize(("wanted", "told"), [(2.2, False), (2.29, True)])
def test_a_reference_within_three_deviations_counts_as_reached(wanted, told):
    """Outputs to 2; the predicted mean comes to 2.7 and 3.6 times sqrt(P_err) near to these."""
    drive = controller(
        lambda x, u, dt: np.array([u[0] + u[1]]), None, state=[0.0], control=[1.0, 1.0], horizon=1, P_err=0.01
    )
    found = {drive.step([0.0], wanted).status for _ in range(80)}
    assert (Status.NOT_REACHED in found) is told


@pytest.mark.parametrize(("horizon", "patience"), [(3, 50), ((3, 8), 80)])
def test_a_reference_that_is_not_reached_is_told_in_time_and_controls_are_tried_singly(horizon, patience):
    """Output u0 + u1 of at most 2, wanted at 10: after the step to the bound nothing shrinks any more."""
    drive = controller(
        lambda x, u, dt: np.array([u[0] + u[1]]), None, state=[0.0], control=[1.0, 1.0], horizon=horizon,
        Pu=[[0.4, 0.1], [0.1, 0.4]], Qu=[[0.4, 0.1], [0.1, 0.4]], P_err=0.01,
    )  # fmt: skip
    told, together = [], []
    for _ in range(patience + 9):
        result = drive.step([0.0], 10.0)
        told.append(result.status is Status.NOT_REACHED)
        moved = np.abs(result.sigma_points - result.before) > 1e-9
        together.append((moved.sum(axis=1) > 1).any())
    assert told.index(True) == patience + 1
    assert together.index(False) == patience + 2
    assert all(told[patience + 1 :])
    assert not any(together[patience + 2 :])
    assert drive.step([0.0], 10.2).status is Status.NOT_REACHED
    assert drive.step([0.0], 10.4).status is not Status.NOT_REACHED
    drive.step([0.0], 1.0)
    moved = np.abs(drive.step([0.0], 1.0).sigma_points - drive.control) > 1e-9
    assert (moved.sum(axis=1) > 1).any()


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (([0.0], 0.1), r"state has shape \(1,\)"),
        ((["x", 0.0], 0.1), "state"),
        (([0.0, 1j], 0.1), "state"),
        (([0.0, 0.0], [0.1, 0.2, 0.3]), "reference"),
        (([0.0, 0.0], "far"), "reference"),
        (([0.0, 0.0], None), "reference"),
        (([0.0, 0.0], [None]), "reference"),
        (([0.0, 0.0], [[0.1]]), "reference"),
        (([0.0, 0.0], 0.1, [1.0, 2.0]), r"Qu .*\(2,\).*\(2, 2\)"),
    ],
)
def test_a_step_names_what_has_another_shape_or_is_no_number(arguments, named):
    state, reference, *noise = arguments
    with pytest.raises(ValueError, match=named):
        controller(straight, lambda x: x[0], state=[0.0, 0.0], control=[0.0, 0.0]).step(
            state, reference, **({"Qu": noise[0]} if noise else {})
        )


@pytest.mark.parametrize("given", [{"control": [0.0]}, {"Pu": [1.0, 1.0]}, {"control": "full"}])
def test_a_new_start_names_what_has_another_shape_or_is_no_number(given):
    drive = controller(straight, lambda x: x[0], state=[0.0, 0.0], control=[0.0, 0.0])
    with pytest.raises(ValueError, match=next(iter(given))):
        drive.reset(**given)
    assert np.array_equal(drive.control, [0.0, 0.0])


def test_a_reference_that_is_not_finite_leaves_no_trace():
    """The first step takes the control after the reference once a reference has moved."""
    seen, fresh = (
        controller(
            straight, lambda x: x[0], state=[0.0, 0.0], control=[0.0, 0.0], after_reference={"u0": 1.0}
        )
        for _ in range(2)
    )
    assert seen.step([0.0, 0.0], np.nan).status is Status.KEPT_PREVIOUS
    for reference in (0.0, 0.0, 0.5, 0.5):
        first, second = (drive.step([0.0, 0.0], reference) for drive in (seen, fresh))
        assert np.array_equal(first.control, second.control)
        assert np.array_equal(first.covariance, second.covariance)


def quick_start():
    """The code on the README's page."""
    page = (ROOT / "README.md").read_text(encoding="utf-8")
    return page.partition("## UTC on your own plant")[2].partition("```python\n")[2].partition("```")[0]


def test_the_quick_start_runs_as_printed(capsys):
    """At most 25 lines; the pendulum hangs at 1 rad under 9.81 sin(1) = 8.255."""
    code = quick_start()
    assert 10 < len(code.splitlines()) <= 25
    exec(code, {})
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith("angle 1.0000 rad, control 8.255 +-")
    assert second.startswith("Solved;")


COUNT = """
from numba.core import event
with event.install_recorder("numba:compile") as recorder:
    exec(compile(open({path!r}).read(), {path!r}, "exec"))
print("compilations:", sum(record.is_start for _, record in recorder.buffer))
"""
JITTED = ("@njit  # optional: plain Python works too, more slowly\n", "from numba import njit\n")


def test_the_quick_start_with_a_plain_plant_compiles_nothing(tmp_path):
    """In a new process without a cache."""
    code, path = quick_start(), tmp_path / "quick_start.py"
    for line in JITTED:
        assert line in code
        code = code.replace(line, "")
    path.write_text(code, encoding="utf-8")
    environment = {"PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(tmp_path / "empty")}
    done = subprocess.run(
        [sys.executable, "-c", COUNT.format(path=str(path))],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.endswith("compilations: 0\n")
