# SPDX-License-Identifier: Apache-2.0
"""The oracle against algebra and exact solutions: nothing here touches the code under test."""

import itertools

import aerodynamics as aero
import numpy as np
import paper_utc as pu
import plain_utc
import pytest
from scipy.spatial.transform import Rotation

DT = 0.0042
UNBOUNDED = np.full(4, np.inf)
SLEW = np.array([np.inf, np.inf, np.inf, 3.5 * DT])


def dense_covariance(m, seed):
    A = np.random.default_rng(seed).normal(size=(m, m))
    return A @ A.T + 0.1 * np.eye(m)


@pytest.mark.parametrize("signs", list(itertools.product((-1.0, 1.0), repeat=3)))
def test_the_printed_covariance_is_indefinite_for_every_choice_of_signs(signs):
    """An arrow matrix: its outer eigenvalues solve (6.25 - e)(.01 - e) = |q|^2."""
    P = pu.initial_covariance(*signs)
    outer = np.sort(np.roots([1.0, -6.26, 0.0625 - 0.74**2 - 0.74**2 - 0.56**2]))
    np.testing.assert_allclose(outer, [-0.208, 6.468], atol=5e-4)
    np.testing.assert_allclose(np.linalg.eigvalsh(P), [outer[0], 0.01, 0.01, outer[1]], rtol=1e-12)
    np.testing.assert_allclose(P[0, 1:], np.multiply(signs, [0.74, 0.74, 0.56]))
    np.testing.assert_array_equal(P, P.T)
    np.testing.assert_array_equal(pu.process_noise(*signs), 0.1 * P)


@pytest.mark.parametrize(
    ("given", "signs"),
    [
        (("eq_q1", 2.0, 1.0), (1.0, -1.0)),  # left turn: negative for k_left
        (("eq_q1", -2.0, 1.0), (-1.0, 1.0)),  # right turn: negative for k_right
        (("eq_q3", 2.0, 1.0), (-1.0, -1.0)),
        (("eq_q3", -2.0, -1.0), (1.0, 1.0)),
        (("none", 2.0, 1.0), (0.0, 0.0)),
        (("eq_q1", 0.0, 1.0, -1.0), (-1.0, 1.0)),
        (("eq_q3", 1.0, 1.0, -1.0), (-1.0, -1.0)),
    ],
)
def test_coupling_signs(given, signs):
    assert pu.coupling_signs(*given) == signs


#                k: 0    1    2    3    4    5    6
HAND_WORKED = [0.0, 1.0, 2.0, 3.0, 2.0, 1.0, 0.0]
SIGNED = np.array([0.0, 0.0, 1.0, 2.0, 0.0, -1.0, -2.0, -2.0, -1.0, 0.0, 0.0])


def test_s14_on_a_hand_worked_reference():
    """|differences| k -> k+1: + + + - - -; k=0: s=-1, so look ahead to 2->3: -.  k=1: to 3->4: +.  k=2: s>0, so
    Delta(2): -.  k=3: look ahead to 5->6: +. And s14(k-1) = 0 belongs to the look-ahead branch.
    """
    assert pu.s14_sequence(HAND_WORKED, 2, 4).tolist() == [-1, 1, -1, 1]
    assert pu.s14_sequence(HAND_WORKED, 3, 1, initial=0.0).tolist() == [1]
    for initial in (-1.0, 1.0):  # kept where nothing changes
        assert pu.s14_sequence(np.ones(9), 1, 7, initial=initial).tolist() == [initial] * 7


def test_s14_depends_on_the_magnitude_only_and_the_reference_sign_comes_after():
    raw = pu.s14_sequence(SIGNED, 1, 9)
    np.testing.assert_array_equal(raw, pu.s14_sequence(-SIGNED, 1, 9))
    signed = pu.s14_sequence(SIGNED, 1, 9, times_reference_sign=True)
    np.testing.assert_array_equal(signed, raw * [1, 1, 1, 1, 1, -1, -1, -1, -1])  # zero at 4 keeps +


def yaw_plant(x, u, dt):
    """A scalar yaw rate: x' = 6 alpha - (5 Cm + .2) x + .3 (k_right - k_left), one Euler step."""
    return x + dt * (6.0 * u[3] - (5.0 * u[0] + 0.2) * x + 0.3 * (u[1] - u[2]))


def problem(steps, low=-UNBOUNDED, high=UNBOUNDED, change=UNBOUNDED, **more):
    return plain_utc.Problem(
        yaw_plant, lambda x: x, DT, steps, low, high, change, np.eye(1), 0.25, 0.0, **more
    )


@pytest.mark.parametrize(
    ("point", "moved"),
    [
        # 1.5 (.01) + .5 = .515; mean inside: clipped to 0; 1.5 (5) - 3.5 = 4; 1.5 (1.5) - .85 = 1.4
        ([-1.0, -3.0, 7.0, 1.7], [0.515, 0.0, 4.0, 1.4]),
        ([3.0, 6.0, 1.0, -1.9], [3.0, 5.0, 1.0, -1.5]),
        ([0.5, 0.0, 0.0, 9.0], [0.5, 0.0, 0.0, -1.5]),  # a long excess passes the opposite bound
    ],
)
def test_points_move_off_a_bound_only_where_the_mean_sits_on_it(point, moved):
    p = problem((1,), np.array(pu.U_MIN), np.array(pu.U_MAX))
    found = plain_utc.bounded(np.array(point), np.array([0.01, 2.0, 5.0, 1.5]), p)
    np.testing.assert_allclose(found, moved, rtol=1e-14)


def yaw_rates(alphas, x=0.0):
    """After each step with these alpha, Cm = .5 and k_left - k_right = 1."""
    for alpha in alphas:
        x += DT * (6.0 * alpha - 2.7 * x - 0.3)
        yield x


def test_a_held_alpha_ramps_at_the_slew_rate():
    point = np.array([0.5, 1.0, 2.0, 0.5])
    of_all = problem((1, 2, 3), np.array(pu.U_MIN), np.array(pu.U_MAX), SLEW)
    found, saved = plain_utc.to_the_horizon(point, np.array([0.5, 0.0, 0.0, 0.1]), np.zeros(1), None, of_all)
    np.testing.assert_allclose(found, [*yaw_rates(0.1 + 3.5 * DT * np.arange(1, 4))], rtol=1e-13)
    np.testing.assert_array_equal(saved, point)


@pytest.mark.parametrize("change", [UNBOUNDED, SLEW])
def test_the_increments_of_alpha_telescope_without_limits_and_count_from_what_the_limits_leave(change):
    """Five steps from alpha = .2; r = j^2 asks for more than the slew rate lets pass at each."""
    r, y = np.arange(9.0) ** 2, [1.0]
    law = pu.alpha_by_the_pose(r, lambda x: float(x[0]), pu.Settings(dt=DT, tau=3, known_dynamics=True))
    point = np.array([0.5, 0.0, 1.0, 0.2])
    of_law = problem((1, 2, 3, 4, 5), change=change, dynamics=law)
    found, saved = plain_utc.to_the_horizon(point, point, np.ones(1), None, of_law)
    for j in range(1, 6):
        free = 0.2 + 1.5 * j**2 - 1.5 * (y[j - 1] - 1.0) + 0.1 * (j**2 + 6 * j)
        alpha = free if change is UNBOUNDED else 0.2 + 3.5 * DT * j
        assert j > 1 or saved[3] == pytest.approx(alpha, rel=1e-12)
        y += yaw_rates([alpha], y[-1])
    np.testing.assert_allclose(found, y[1:], rtol=1e-12)


@pytest.mark.parametrize(("m", "outputs"), [(4, 1), (4, 2), (4, 3), (4, 4), (3, 1), (6, 2)])
@pytest.mark.parametrize("noise", [1.0, 1e-4])
def test_an_unbounded_linear_step_is_the_closed_form(m, outputs, noise):
    rng = np.random.default_rng(10 * m + outputs)
    U, Pu, B = rng.normal(size=m), dense_covariance(m, m), rng.normal(size=(outputs, m))
    R, r, Qu = noise * dense_covariance(outputs, 7), rng.normal(size=outputs), dense_covariance(m, 8)
    free = {"umin": np.full(m, -np.inf), "umax": np.full(m, np.inf), "rate": np.inf}
    s = pu.Settings(N=3, P_err=R, floor=1e-12, **free)
    step = pu.utc_step(
        U, Pu, np.zeros(outputs), np.zeros(4), Qu, lambda x, u, dt: B @ u, lambda x: x, lambda x: float(x[0]), s, r
    )  # fmt: skip
    C_y = B @ Pu @ B.T + R
    gain = Pu @ B.T @ np.linalg.inv(C_y)
    expected = U + gain @ (r - B @ U)
    assert np.abs(step.U - expected).max() <= 1e-12 * max(1.0, np.abs(expected).max())
    assert np.abs(step.U - U).max() > 1e-3
    np.testing.assert_allclose(step.Pu, Pu + Qu - gain @ C_y @ gain.T, atol=1e-10)


def test_force_and_moment_are_the_sum_of_segments_damping_and_hands():
    rng = np.random.default_rng(1)
    R, inertia = Rotation.random(16, rng).as_matrix(), dense_covariance(3, 1)
    p = aero.Posture(rng.normal(0, 0.4, (16, 3)), R, rng.uniform(0.01, 0.1, (16, 3)), 80.0, inertia)
    c, V, omega = aero.Constants(Cm_roll=8.0, Cm_pitch=7.0), rng.normal(0, 30, 3), rng.normal(0, 3, 3)
    force, moment = np.array([0.0, 0.0, -140.0]), np.array([35.0 * (1.0 - 0.4), 0.0, 0.0])
    for r, R, CdA in zip(p.r, p.R, p.CdA, strict=True):
        v = V + np.cross(omega, r)
        drag = -0.5 * 1.225 * np.sqrt(v @ v) * (R @ np.diag(CdA) @ R.T @ v)
        assert drag @ v < 0.0  # it takes energy
        force, moment = force + drag, moment + np.cross(r, drag)
    moment -= 0.5 * 1.225 * np.sqrt(V @ V) * 1.25 * 1.78**2 / 2 * np.array([8.0, 7.0, 0.5]) * omega
    found = aero.force_and_moment(V, omega, np.array([0.5, 1.0, 0.4, 0.2]), p, c)
    np.testing.assert_allclose(found, [force, moment], rtol=1e-12)
