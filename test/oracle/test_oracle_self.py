# SPDX-License-Identifier: Apache-2.0
"""The oracle against algebra, exact solutions and SciPy: nothing here touches the code under test."""

from __future__ import annotations

import itertools
from dataclasses import replace

import aerodynamics as aero
import numpy as np
import paper_utc as pu
import pytest
from scipy.spatial.transform import Rotation

DT = 0.0042
SIGNS = list(itertools.product((-1.0, 1.0), repeat=3))
FREE = {"umin": np.full(4, -np.inf), "umax": np.full(4, np.inf), "rate": np.inf}


def dense_covariance(m: int, seed: int) -> np.ndarray:
    A = np.random.default_rng(seed).normal(size=(m, m))
    return A @ A.T + 0.1 * np.eye(m)


def yaw_plant(x: np.ndarray, u: np.ndarray, dt: float) -> np.ndarray:
    """A scalar yaw rate: x' = 6 alpha - (5 Cm + .2) x + .3 (k_right - k_left), one Euler step."""
    return x + dt * (6.0 * u[3] - (5.0 * u[0] + 0.2) * x + 0.3 * (u[1] - u[2]))


def first(x: np.ndarray) -> float:
    return float(x[0])


# --------------------------------------------------------------------------- posture controller


def test_pose_controller_proportional_feed_forward_and_limits() -> None:
    assert pu.pose_controller(0.5, 0.2, 0.5, dt=1.0) == pytest.approx(1.5 * 0.3 + 0.1 * 0.5)
    assert pu.pose_controller(9.0, 0.0, 1.4, dt=1.0) == 1.5
    assert pu.pose_controller(-9.0, 0.0, -1.4, dt=1.0) == -1.5
    assert pu.pose_controller(9.0, 0.0, 0.0, dt=DT) == pytest.approx(3.5 * DT)
    assert pu.pose_controller(-9.0, 0.0, 0.0, dt=DT) == pytest.approx(-3.5 * DT)


# --------------------------------------------------------------------------- covariances and their signs


@pytest.mark.parametrize("signs", SIGNS)
def test_printed_covariance_is_indefinite_for_every_sign_choice(signs) -> None:
    P = pu.initial_covariance(*signs)
    np.testing.assert_allclose(np.linalg.eigvalsh(P), [-0.208, 0.01, 0.01, 6.468], atol=5e-4)
    # Arrow matrix: the two outer eigenvalues solve (6.25 - e)(.01 - e) = |q|^2.
    outer = np.roots([1.0, -6.26, 0.0625 - 0.74**2 - 0.74**2 - 0.56**2])
    np.testing.assert_allclose(np.sort(outer), np.linalg.eigvalsh(P)[[0, 3]], rtol=1e-12)
    np.testing.assert_array_equal(pu.process_noise(*signs), 0.1 * P)


def test_covariance_elements_counted_from_one() -> None:
    P = pu.initial_covariance(-1.0, 1.0, -1.0)
    assert (P[0, 1], P[0, 2], P[0, 3], P[1, 2]) == (-0.74, 0.74, -0.56, 0.0)
    np.testing.assert_array_equal(P, P.T)


def test_coupling_signs() -> None:
    assert pu.coupling_signs("eq_q1", 2.0, 1.0) == (1.0, -1.0)  # left turn: negative for k_left
    assert pu.coupling_signs("eq_q1", -2.0, 1.0) == (-1.0, 1.0)  # right turn: negative for k_right
    assert pu.coupling_signs("eq_q3", 2.0, 1.0) == (-1.0, -1.0)
    assert pu.coupling_signs("eq_q3", -2.0, -1.0) == (1.0, 1.0)
    assert pu.coupling_signs("none", 2.0, 1.0) == (0.0, 0.0)
    assert pu.coupling_signs("eq_q1", 0.0, 1.0, sign_of_zero=-1.0) == (-1.0, 1.0)
    assert pu.coupling_signs("eq_q3", 1.0, 1.0, sign_of_zero=-1.0) == (-1.0, -1.0)
    with pytest.raises(ValueError, match="unknown coupling"):
        pu.coupling_signs("eq_q2", 0.0, 1.0)


def test_s14_on_a_hand_worked_reference() -> None:
    #            k: 0    1    2    3    4    5    6
    reference = [0.0, 1.0, 2.0, 3.0, 2.0, 1.0, 0.0]
    # |differences| k -> k+1: + + + - - -.
    # k=0: s=-1, so look ahead to 2->3: -.  k=1: look ahead to 3->4: +.
    # k=2: s>0, so Delta(2): -.             k=3: look ahead to 5->6: +.
    assert pu.s14_sequence(reference, 2, 4).tolist() == [-1, 1, -1, 1]
    # s14(k-1) = 0 belongs to the look-ahead branch.
    assert pu.s14_sequence(reference, 3, 1, initial=0.0).tolist() == [1]


def test_s14_depends_on_the_magnitude_only_and_the_reference_sign_comes_after() -> None:
    r = np.array([0.0, 0.0, 1.0, 2.0, 0.0, -1.0, -2.0, -2.0, -1.0, 0.0, 0.0])
    raw = pu.s14_sequence(r, 1, 9)
    np.testing.assert_array_equal(raw, pu.s14_sequence(-r, 1, 9))
    np.testing.assert_array_equal(raw, pu.s14_sequence(np.abs(r), 1, 9))
    signed = pu.s14_sequence(r, 1, 9, times_reference_sign=True)
    np.testing.assert_array_equal(signed, raw * [1, 1, 1, 1, 1, -1, -1, -1, -1])  # zero at 4 keeps +


def test_s14_keeps_its_value_where_nothing_changes() -> None:
    assert pu.s14_sequence(np.ones(9), 1, 7).tolist() == [-1.0] * 7
    assert pu.s14_sequence(np.ones(9), 1, 7, initial=1.0).tolist() == [1.0] * 7


def test_repair_and_square_root() -> None:
    P = pu.initial_covariance(1.0, -1.0, -1.0)
    fixed = pu.repair(P, 1e-6)
    np.testing.assert_allclose(np.linalg.eigvalsh(fixed), [1e-6, 0.01, 0.01, 6.468], atol=5e-4)
    S = pu.matrix_square_root(fixed)
    np.testing.assert_array_equal(S, S.T)
    np.testing.assert_allclose(S @ S, fixed, atol=1e-12)
    assert np.linalg.eigvalsh(S).min() > 0.0
    np.testing.assert_allclose(S @ P, P @ S, atol=1e-9)  # same eigenvectors

    good = dense_covariance(4, 1)
    np.testing.assert_allclose(pu.repair(good, 1e-9), good, rtol=1e-13, atol=1e-14)
    skew = np.array([[0.0, 0.3], [-0.3, 0.0]])
    np.testing.assert_allclose(pu.repair(np.eye(2) + skew, 1e-9), np.eye(2), rtol=1e-14)


# --------------------------------------------------------------------------- sigma points


@pytest.mark.parametrize("m", [1, 2, 4, 7])
@pytest.mark.parametrize("W0", [0.0, 0.25, 0.6])
def test_sigma_points_carry_mean_and_covariance(m, W0) -> None:
    U, P = np.arange(1.0, m + 1), dense_covariance(m, m)
    points, W = pu.sigma_points(U, P, W0), pu.weights(m, W0)
    assert points.shape == (2 * m + 1, m)
    assert W.sum() == pytest.approx(1.0, abs=1e-15)
    mean, covariance = pu.predict(points, W, np.zeros((m, m)))
    np.testing.assert_allclose(mean, U, rtol=1e-13)
    np.testing.assert_allclose(covariance, P, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(points[1 : m + 1] + points[m + 1 :], np.tile(2 * U, (m, 1)), rtol=1e-13)


def test_sigma_points_order_and_scale() -> None:
    points = pu.sigma_points([10.0, 20.0], np.diag([4.0, 9.0]), 0.5)  # sqrt(2 / .5) = 2
    np.testing.assert_allclose(points, [[10, 20], [14, 20], [10, 26], [6, 20], [10, 14]], rtol=1e-14)


def test_bound_moves_points_off_the_boundary_only_where_the_mean_sits_on_it() -> None:
    U = np.array([0.01, 2.0, 5.0, 1.5])
    points = np.array([[-1.0, -3.0, 7.0, 1.7], [3.0, 6.0, 1.0, -1.9]])
    moved = pu.bound(points, U, pu.U_MIN, pu.U_MAX)
    # 1.5 (.01) + .5 = .515; mean inside: clipped to 0; 1.5 (5) - 3.5 = 4; 1.5 (1.5) - .85 = 1.4
    np.testing.assert_allclose(moved, [[0.515, 0.0, 4.0, 1.4], [3.0, 5.0, 1.0, -1.5]], rtol=1e-14)
    # Half the excess on the other side: U + (U - U^i) / 2.
    assert moved[0, 2] == U[2] + 0.5 * (U[2] - points[0, 2])
    # A very long excess passes the opposite bound and is bounded there.
    far = pu.bound([[0.5, 0.0, 0.0, 9.0]], [0.5, 0.0, 0.0, 1.5], pu.U_MIN, pu.U_MAX)
    assert far[0, 3] == -1.5


# --------------------------------------------------------------------------- propagation


def run(point, alpha_before=0.0, x=0.0, reference=None, **changes):
    s = replace(pu.Settings(N=5, dt=DT), **changes)
    reference = np.zeros(s.N + s.tau + 1) if reference is None else np.asarray(reference)
    return pu.propagate(
        np.array(point), alpha_before, np.array([x]), reference, yaw_plant, lambda z: z, first, s
    )


def test_held_alpha_ramps_at_the_slew_rate_and_the_rest_is_constant() -> None:
    out = run([0.5, 1.0, 2.0, 0.5], alpha_before=0.1)
    np.testing.assert_allclose(out.applied[:, 3], 0.1 + 3.5 * DT * np.arange(1, 6), rtol=1e-14)
    np.testing.assert_array_equal(out.applied[:, :3], np.tile([0.5, 1.0, 2.0], (5, 1)))
    np.testing.assert_array_equal(out.U, [0.5, 1.0, 2.0, 0.5])


def test_held_output_is_the_exact_solution_of_the_linear_recursion() -> None:
    out = run([0.5, 1.0, 2.0, 0.3], alpha_before=0.3, x=2.0, N=40)
    decay, inflow = 1.0 - DT * 2.7, DT * (6.0 * 0.3 - 0.3)
    assert out.Y[0] == pytest.approx(decay**40 * 2.0 + inflow * (1 - decay**40) / (1 - decay), rel=1e-13)


def test_incremental_without_limits_telescopes() -> None:
    r = np.random.default_rng(5).normal(size=9)
    out = run([0.5, 0.0, 0.0, 0.2], 0.0, 1.0, r, known_dynamics=True, tau=3, **FREE)
    y = [1.0, 1.0]  # y_-1 := y_0
    x = np.array([1.0])
    for u in out.applied:
        x = yaw_plant(x, u, DT)
        y.append(first(x))
    for j in range(1, 6):
        expected = 0.2 + 1.5 * (r[j] - r[0]) - 1.5 * (y[j] - y[0]) + 0.1 * (r[j + 3] - r[3])
        assert out.commanded_alpha[j - 1] == pytest.approx(expected, rel=1e-12)
    np.testing.assert_array_equal(out.applied[:, 3], out.commanded_alpha)
    assert out.Y[0] == y[-1]


def test_incremental_limits_and_what_is_saved() -> None:
    r = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0])
    out = run([0.5, 0.0, 0.0, 0.0], 0.0, 0.0, r, known_dynamics=True)
    np.testing.assert_allclose(out.applied[:, 3], 3.5 * DT * np.arange(1, 6), rtol=1e-13)
    assert out.commanded_alpha[0] == pytest.approx(1.6)
    assert out.U[3] == pytest.approx(3.5 * DT)
    assert out.commanded_alpha[1] == pytest.approx(3.5 * DT + 1.6 - 1.5 * (6.0 * 3.5 * DT * DT), rel=1e-12)


# --------------------------------------------------------------------------- the whole step


@pytest.mark.parametrize(("m", "l_outputs"), [(4, 1), (4, 2), (4, 3), (4, 4), (3, 1), (6, 2)])
@pytest.mark.parametrize("noise", [1.0, 1e-4])
def test_unbounded_linear_step_is_the_linear_oracle(m, l_outputs, noise) -> None:
    rng = np.random.default_rng(10 * m + l_outputs)
    U, Pu, B = rng.normal(size=m), dense_covariance(m, m), rng.normal(size=(l_outputs, m))
    R, r, Qu = noise * dense_covariance(l_outputs, 7), rng.normal(size=l_outputs), dense_covariance(m, 8)
    unbounded = {"umin": np.full(m, -np.inf), "umax": np.full(m, np.inf), "rate": np.inf}
    s = pu.Settings(N=3, P_err=R, floor=1e-12, **unbounded)
    step = pu.utc_step(
        U, Pu, np.zeros(l_outputs), np.zeros(4), Qu, lambda x, u, dt: B @ u, lambda x: x, first, s, r
    )
    expected = pu.linear_oracle(U, Pu, B, R, r)
    assert np.abs(step.U - expected).max() <= 1e-12 * max(1.0, np.abs(expected).max())
    assert np.abs(step.U - U).max() > 1e-3
    gain = Pu @ B.T @ np.linalg.inv(B @ Pu @ B.T + R)
    np.testing.assert_allclose(step.updated.K, gain, atol=1e-11)
    np.testing.assert_allclose(step.Pu, Pu + Qu - gain @ (B @ Pu @ B.T + R) @ gain.T, atol=1e-10)


# --------------------------------------------------------------------------- hands and rigid body


@pytest.mark.parametrize(("direction", "along_z"), [("ventral", -100.0), ("dorsal", 100.0)])
def test_the_printed_force_and_moment_are_one_force_at_each_hand(direction: str, along_z: float) -> None:
    """r x F of hands at y = +-lx, in right-handed axes."""
    assert np.linalg.det(pu.PAPER_AXES[direction]) == pytest.approx(1.0)
    rng = np.random.default_rng(20)
    for k_right, k_left in rng.uniform(0, 5, size=(5, 2)):
        moment, force = pu.hand_moment_and_force(k_right, k_left, force=direction)
        right, left = np.array([0, 0, along_z * k_right]), np.array([0, 0, along_z * k_left])
        np.testing.assert_allclose(
            np.cross([0, -0.35, 0], right) + np.cross([0, 0.35, 0], left), moment, rtol=1e-13
        )
        np.testing.assert_allclose(right + left, force)


def test_a_left_hand_takes_the_left_side_down_where_the_yaw_rate_is_positive_to_the_left() -> None:
    """With y dorsal, as the paper's yaw rate is; M_x < 0 lowers the left side."""
    moment, force = pu.hand_moment_and_force(0.0, 5.0, force="ventral")
    assert pu.PAPER_AXES["ventral"][1] @ [0.0, 0.0, 1.0] == 1.0
    assert moment[0] == pytest.approx(-175.0)
    assert force[2] == pytest.approx(-500.0)


def random_posture(seed: int, segments: int = 16) -> aero.Posture:
    rng = np.random.default_rng(seed)
    R = Rotation.random(segments, rng).as_matrix()
    inertia = dense_covariance(3, seed) + 3.0 * np.eye(3)
    return aero.Posture(
        rng.normal(0, 0.4, (segments, 3)), R, rng.uniform(0.01, 0.1, (segments, 3)), 80.0, inertia
    )


def random_state(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.concatenate(
        [rng.normal(size=3), Rotation.random(None, rng).as_quat(), rng.normal(0, 30, 3), rng.normal(0, 3, 3)]
    )


U_TEST = np.array([0.5, 1.0, 0.4, 0.2])


def test_segment_forces_one_by_one() -> None:
    p, x = random_posture(1), random_state(2)
    V, omega = x[7:10], x[10:13]
    forces = aero.segment_forces(V, omega, p, 1.2)
    for i in range(16):
        v = V + np.cross(omega, p.r[i])
        expected = -0.5 * 1.2 * np.sqrt(v @ v) * (p.R[i] @ np.diag(p.CdA[i]) @ p.R[i].T @ v)
        np.testing.assert_allclose(forces[i], expected, rtol=1e-12)
        assert forces[i] @ v < 0.0  # drag takes energy


def test_force_and_moment_is_the_sum_of_its_parts() -> None:
    p, x, c = random_posture(3), random_state(4), aero.Constants(Cm_roll=8.0, Cm_pitch=7.0)
    V, omega = x[7:10], x[10:13]
    F, M = aero.force_and_moment(V, omega, U_TEST, p, c)
    segments = aero.segment_forces(V, omega, p, c.rho)
    scale = 0.5 * 1.225 * np.sqrt(V @ V) * 1.25 * 1.78**2 / 2
    expected = (
        sum(np.cross(p.r[i], segments[i]) for i in range(16)) - scale * np.array([8.0, 7.0, 0.5]) * omega
    )
    np.testing.assert_allclose(M, expected + np.array([35.0 * (1.0 - 0.4), 0, 0]), rtol=1e-12)
    np.testing.assert_allclose(F, segments.sum(axis=0) - np.array([0, 0, 140.0]), rtol=1e-12)
