# SPDX-License-Identifier: Apache-2.0
"""The skydiver's UTC and its coupling against the paper's equations written out apart from the code."""

import numpy as np
import paper_utc as paper
import plain_utc
import pytest
from scipy.spatial.transform import Rotation
from skydivers import parts_of

from skydiver_utc.controllers.utc.coupling import CouplingSchedule
from skydiver_utc.controllers.utc.dynamics import incremental
from skydiver_utc.parameters import load_scenario

DT = 0.0042
TURN = "fast_turn_unknown_dynamics"
COUPLING = load_scenario(TURN).controller.coupling
NAMES = ("Cm_damp_yaw", "k_right", "k_left", "alpha")
INITIAL = np.array(paper.U_INITIAL)
RATE = np.array([np.inf, np.inf, np.inf, paper.SLEW])


def schedule(k_hyst, **changes):
    settings = COUPLING.replace(k_hyst_s=k_hyst * DT, **changes)
    return CouplingSchedule(settings, np.diag(paper.VARIANCES), NAMES, Qu_ratio=0.1, dt_s=DT)


def yaw_rate(state):
    return float(state[12])


class Turn:
    """A scenario's turn: its plant, its controller, and what the paper's text takes of it."""

    def __init__(self, name, **changes):
        scenario = load_scenario(name, {f"controller.{n.replace('__', '.')}": v for n, v in changes.items()})
        self.law = scenario.controller
        self.plant, reference, self.controller = parts_of(scenario)
        self.reference = reference.preview(0, 600)
        self.signal = self.reference[:, 0]
        self.s14 = paper.s14_sequence(self.signal, round(1.0 / DT), 20, times_reference_sign=True)

    def held_step(self, x, u, dt):
        """The controller's model: the posture held over the step."""
        following = np.empty(13)
        self.plant.bound_model.step(x, np.ascontiguousarray(u), following)
        return following

    def window(self, k):
        return self.reference[k : k + self.controller.preview_steps + 1]

    def covariances(self, k, Pu):
        """Pu, that of the first step if there is none yet, and Qu."""
        s12, s13 = paper.coupling_signs("eq_q1", self.signal[k], self.signal[k + 1])
        first = paper.initial_covariance(s12, s13, -1.0) if Pu is None else Pu
        return first, paper.process_noise(s12, s13, self.s14[k])

    def settings(self, **changes):
        inside = self.law.dynamics
        of_dynamics = {} if inside is None else {
            "known_dynamics": True, "tau": round(inside.tau_s / DT), "Kp": inside.K_p, "KFF": inside.K_FF,
        }  # fmt: skip
        floor = self.law.covariance_floor
        return paper.Settings(dt=DT, N=self.law.horizon_steps, floor=floor, **of_dynamics, **changes)


def assert_controls_alike(turn, expected_step, rtol=1e-9):
    """Twelve closed-loop steps against the paper's text driving the same plant, begun again after half of them."""
    x, U, Pu = turn.plant.initial_state(), turn.plant.initial_control(), None
    for k in range(12):
        Pu, Qu = turn.covariances(k, Pu)
        if k == 6:
            turn.controller.reset(U, Pu)
        decision = turn.controller.decide(x, turn.window(k))
        U, Pu, predicted = expected_step(U, Pu, x, turn.window(k), Qu)
        np.testing.assert_allclose(decision.control, U, rtol=rtol, atol=0.1 * rtol)
        assert decision.telemetry[0] == pytest.approx(float(predicted[0]), rel=rtol, abs=1e-11)
        x = turn.held_step(x, U, DT)


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        (TURN, {}),
        ("fast_turn_pi_dynamics", {}),
        ("fast_turn_pi_dynamics", {"dynamics__tau_s": 0.0084}),
        ("fast_turn_pi_dynamics", {"horizon_steps": 20, "dynamics__K_p": 2.2}),
    ],
)
def test_the_skydivers_utc_equals_the_paper(name, changes):
    turn = Turn(name, **changes)

    def step(U, Pu, x, window, Qu):
        signal = window[:, 0]
        return paper.utc_step(
            U, Pu, x, signal, Qu, turn.held_step, lambda s: s[12:13], yaw_rate, turn.settings()
        )

    assert_controls_alike(turn, step)


def test_further_outputs_equal_the_paper_with_three_outputs():
    """Yaw rate, roll rate and fall rate tracked together."""
    outputs = {
        "roll_rate": {"reference": 0.05, "P_err": 1e-4},
        "fall_rate": {"reference": 56.27, "P_err": 0.05},
    }
    turn = Turn("fast_turn_pi_dynamics", outputs=outputs)
    settings = turn.settings(P_err=np.diag([turn.law.P_err, 1e-4, 0.05]))

    def tracked(x):
        return np.array([x[12], x[10], -(Rotation.from_quat(x[3:7]).apply(x[7:10]))[2]])

    def step(U, Pu, x, window, Qu):
        signal, wanted = window[:, 0], np.array([window[turn.law.horizon_steps, 0], 0.05, 56.27])
        return paper.utc_step(U, Pu, x, signal, Qu, turn.held_step, tracked, yaw_rate, settings, y_ref=wanted)

    assert_controls_alike(turn, step, 1e-8)


def test_nominal_controls_are_outputs_of_the_papers_form():
    """The outputs of the fast turn are the yaw rate and two of the controls."""
    nominal = {"Cm_damp_yaw": {"value": 0.3, "variance": 0.1}, "alpha": {"value": 0.0, "variance": 2.0}}
    turn = Turn(TURN, nominal=nominal)
    problem = plain_utc.Problem(
        turn.held_step, lambda x: x[12:13], DT, (turn.law.horizon_steps,), np.array(paper.U_MIN),
        np.array(paper.U_MAX), RATE * DT, np.diag([turn.law.P_err, 0.1, 2.0]), turn.law.W0,
        turn.law.covariance_floor, None, (0, 3), (0.3, 0.0),
    )  # fmt: skip
    assert_controls_alike(turn, lambda *given: plain_utc.step(*given, problem))


@pytest.mark.parametrize(
    ("signs", "label"), [("yaw_rate", "eq_q1"), ("yaw_acceleration", "eq_q3"), ("none", "none")]
)
def test_signs_of_the_process_noise(signs, label):
    rng = np.random.default_rng(1)
    tried, raw = schedule(2, signs=signs), -1.0
    for _ in range(50):
        r = rng.normal(size=4)
        s12, s13 = paper.coupling_signs(label, r[0], r[1])
        raw = paper.s14_sequence(r, 2, 1, initial=raw)[0]
        expected = paper.process_noise(s12, s13, raw * np.sign(r[0]))
        np.testing.assert_allclose(tried.process_noise(r, INITIAL), expected, rtol=1e-15)


@pytest.mark.parametrize(("label", "signs"), [("eq_q1", "yaw_rate"), ("eq_q3", "yaw_acceleration")])
def test_the_sign_by_the_damping(label, signs):
    """s14 = sign(yr_ref), turned round without damping left; Qu is the nearest matrix that is a covariance."""
    rng = np.random.default_rng(2)
    tried = schedule(2, signs=signs, alpha_sign="damping", low_damping=0.1)
    for Cm_damp in (0.01, 0.1, 0.11, 6.0) * 5:
        r = rng.normal(size=4)
        s14 = np.sign(r[0]) if Cm_damp > 0.1 else -np.sign(r[0])
        printed = paper.process_noise(*paper.coupling_signs(label, r[0], r[1]), s14)
        values, vectors = np.linalg.eigh(printed)
        expected = sum(v * np.outer(x, x) for v, x in zip(values, vectors.T, strict=True) if v > 0.0)
        found = tried.process_noise(r, np.array([Cm_damp, 0.0, 0.0, 0.0]))
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)
        assert np.sign(found[0, 3]) == s14


def test_the_initial_covariance_is_the_printed_one():
    for reference, signs in (
        ([1, 1, 1, 1], (1, -1, -1)),
        ([0, 0, -1, 1], (0, 0, 1)),
        ([0, 0, 0, 0], (0, 0, -1)),
    ):
        found = schedule(2).initial_covariance(np.array(reference, dtype=float))
        np.testing.assert_array_equal(found, paper.initial_covariance(*signs))


@pytest.mark.parametrize(("change", "share"), [(0.25, 0.25), (-0.5, 0.5), (3.0, 1.0), (0.0, 0.02)])
def test_the_row_of_the_damping_grows_with_the_acceleration_ahead(change, share):
    """Beyond the paper: full at 6 rad/s2, the largest |change| in the preview counts, other variances stay."""
    tried = schedule(2, full_acceleration=6.0)
    preview = 1.0 + np.array([0.0, 0.1, 1.1, 1.1]) * change * 6.0 * DT
    full = np.abs(paper.process_noise(1.0, 1.0, 1.0))
    expected = full.copy()
    expected[0, :] *= share
    expected[:, 0] = expected[0, :]
    np.testing.assert_allclose(np.abs(tried.process_noise(preview, INITIAL)), expected, rtol=1e-12)
    np.testing.assert_array_equal(np.abs(tried.initial_covariance(preview)), 10.0 * full)


@pytest.mark.parametrize("j", [0, 1])
def test_proportional_dynamics_are_those_printed(j):
    """eq:m1utc where no rate limit cuts it, for control 2 and output 1."""
    rng = np.random.default_rng(j)
    point, before, y, y_before, preview = (rng.normal(size=size) for size in (4, 4, 5, 5, (6, 1)))
    found, K_p, K_FF, tau = np.empty(4), 3.7, 0.6, 2
    incremental(
        point, before, np.zeros(3), y, y_before, preview, j, np.array([2.0, 1.0, K_p, K_FF, tau]), found
    )
    r, expected = preview[:, 0], point.copy()
    expected[2] = (point if j == 0 else before)[2] + K_p * (r[j + 1] - r[j]) - K_p * (y[1] - y_before[1])
    expected[2] += K_FF * (r[j + 1 + tau] - r[j + tau])
    np.testing.assert_allclose(found, expected, rtol=1e-12)
