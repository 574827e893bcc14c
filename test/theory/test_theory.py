# SPDX-License-Identifier: Apache-2.0
"""The theory of UTC on linear plants, against SciPy, algebra and brute force."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are, solve_discrete_lyapunov
from scipy.signal import cont2discrete

from skydiver_utc.plants.linear import LinearModel, zero_order_hold
from skydiver_utc.theory.linear_plant import to_the_horizon
from skydiver_utc.theory.stability import (
    apart_from_rest,
    ball,
    closed_loop_matrix,
    output_riccati,
    riccati_terms,
)
from skydiver_utc.theory.steady_gain import gain, steady_gain

SHAPES = [(3, 2, 2), (3, 2, 3), (4, 1, 1), (3, 4, 2), (5, 3, 1)]  # n, m, l


def definite(rng, size):
    factor = rng.normal(size=(size, size))
    return factor @ factor.T + 0.1 * np.eye(size)


def random_plant(seed, n, m, outputs, radius=0.9):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n))
    A *= radius / np.abs(np.linalg.eigvals(A)).max()
    return LinearModel(A, rng.normal(size=(n, m)), rng.normal(size=(outputs, n))), rng


def next_covariance(Pu, H, P_err, Qu):
    return Pu - gain(Pu, H, P_err) @ H @ Pu + Qu


def test_zero_order_hold_against_scipy():
    _, rng = random_plant(1, 3, 2, 1)
    A, B = rng.normal(size=(3, 3)), rng.normal(size=(3, 2))
    expected = cont2discrete((A, B, np.eye(3), np.zeros((3, 2))), 0.1)
    for ours, theirs in zip(zero_order_hold(A, B, 0.1), expected, strict=False):
        np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("steps", [1, 2, 7])
def test_the_loop_of_a_horizon(shape, steps):
    """F x + H u is the plant stepped with u held; Z z the law stepped; what rests stays, and is all that Z keeps.

    The Riccati identity: X - (A - B L)' X (A - B L) = cost + effort - additional, and nothing is added for one step.
    """
    n, m, outputs = shape
    plant, rng = random_plant(2, *shape)
    Pu, P_err, Qu = definite(rng, m), definite(rng, outputs), definite(rng, m)
    F, H = to_the_horizon(plant, steps)
    start, u = rng.normal(size=n), rng.normal(size=m)
    x = start
    for _ in range(steps):
        x = plant.A @ x + plant.B @ u
    np.testing.assert_allclose(F @ start + H @ u, plant.C @ x, rtol=1e-11)

    K = steady_gain(H, P_err, Qu).K
    Z, W = closed_loop_matrix(plant, K, steps), apart_from_rest(plant, K)
    following = u - K @ (F @ start + H @ u)
    expected = np.append(plant.A @ start + plant.B @ following, following)
    np.testing.assert_allclose(Z @ np.append(start, u), expected, rtol=1e-10, atol=1e-11)
    at_rest = n + m - W.shape[1]
    assert at_rest == max(m - outputs, 0)
    rest = np.linalg.svd(W.T)[2][W.shape[1] :].T
    np.testing.assert_allclose(Z @ rest, rest, atol=1e-10)
    np.testing.assert_allclose(plant.C @ rest[:n], 0.0, atol=1e-9)
    eigenvalues = np.append(np.linalg.eigvals(W.T @ Z @ W), np.ones(at_rest))
    np.testing.assert_allclose(np.poly(eigenvalues), np.poly(np.linalg.eigvals(Z)), atol=1e-9)

    X = plant.C.T @ np.linalg.inv(P_err) @ plant.C
    closed = plant.A - plant.B @ gain(Pu, H, P_err) @ F
    terms, size = output_riccati(plant, Pu, P_err, steps), np.abs(X).max()
    left = terms.cost + terms.effort - terms.additional
    np.testing.assert_allclose(left, X - closed.T @ X @ closed, atol=1e-8 * size)
    assert bool(np.abs(terms.additional).max() < 1e-9 * size) == (steps == 1)


@pytest.mark.parametrize(("m", "outputs"), [(1, 1), (2, 2), (2, 3), (3, 5), (2, 1), (4, 1), (4, 2), (4, 3)])
def test_the_gain_settles_although_an_unseen_covariance_grows(m, outputs):
    """With more controls than outputs Pu has no fixed point, else that of SciPy's for (I, H', Qu, P_err)."""
    rng = np.random.default_rng(m + 10 * outputs)
    H, P_err, Qu = rng.normal(size=(outputs, m)), definite(rng, outputs), definite(rng, m)
    Pu, steady = definite(rng, m), steady_gain(H, P_err, Qu)
    for _ in range(300):
        before, Pu = Pu, next_covariance(Pu, H, P_err, Qu)
    np.testing.assert_allclose(gain(Pu, H, P_err), steady.K, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(Pu - before, steady.growth, rtol=1e-5, atol=1e-7)
    assert np.linalg.matrix_rank(steady.growth, tol=1e-8) == max(m - outputs, 0)
    start = steady.covariance + 2.0 * steady.growth
    np.testing.assert_allclose(gain(start, H, P_err), steady.K, rtol=1e-9, atol=1e-12)
    following = next_covariance(start, H, P_err, Qu)
    np.testing.assert_allclose(following - start, steady.growth, rtol=1e-8, atol=1e-10)
    memory = np.sort(np.linalg.eigvals(np.eye(m) - steady.K @ H).real)[: min(m, outputs)]
    np.testing.assert_allclose(memory, steady.memory, rtol=1e-9)
    if m <= outputs:
        solution = solve_discrete_are(np.eye(m), H.T, Qu, P_err)
        np.testing.assert_allclose(steady.covariance, solution, rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize("a", [-0.7, 0.0, 0.5, 0.95])
def test_ball_of_a_scalar_is_exact(a):
    """The largest |z| under |d| <= D is D / (1 - |a|), and R is that."""
    found = ball(np.array([[a]]), 0.3)
    np.testing.assert_allclose(found.radius, 0.3 / (1.0 - abs(a)), rtol=1e-12)
    assert found.kept == pytest.approx(found.radius, rel=1e-12)
    assert found.summed == pytest.approx(found.radius, rel=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_value_falls_outside_the_ball_and_the_level_set_is_kept(seed):
    """The worst disturbance of size D at random states: V falls for |z| > R, and V <= p_max R^2 is never left."""
    rng = np.random.default_rng(seed)
    Z = rng.normal(size=(4, 4))
    Z *= 0.9 / np.abs(np.linalg.eigvals(Z)).max()
    D = 0.2
    found = ball(Z, D)
    P = solve_discrete_lyapunov(Z.T, np.eye(4))
    p_max = np.linalg.eigvalsh(P)[-1]

    def value(z):
        return np.einsum("ij,jk,ik->i", z, P, z)

    z = rng.normal(size=(2000, 4))
    z /= np.linalg.norm(z, axis=1, keepdims=True)
    push = (z @ Z.T) @ P
    d = D * push / np.linalg.norm(push, axis=1, keepdims=True)
    outside = 1.0001 * found.radius * z
    assert (value(outside @ Z.T + d) < value(outside)).all()
    level = p_max * found.radius**2
    edge = z * np.sqrt(level / value(z))[:, None]
    assert (np.linalg.norm(edge, axis=1) <= found.kept * (1 + 1e-12)).all()
    assert (value(edge @ Z.T + d) <= level * (1 + 1e-12)).all()


def test_the_ball_itself_can_be_left():
    """A start inside R, no disturbance larger than D, and yet |z| > R: only the larger ball is kept."""
    Z = np.array([[0.2, 40.0], [0.0, 0.2]])
    found = ball(Z, 1.0)
    start = np.array([0.0, found.radius])
    reached = np.linalg.norm(Z @ start)
    assert found.radius < reached <= found.kept


def test_riccati_cost_against_scipy():
    """For the X that SciPy finds to a cost, the cost is found back."""
    plant, rng = random_plant(7, 4, 2, 4, radius=1.2)
    wanted, Pu = definite(rng, 4), definite(rng, 2)
    X = solve_discrete_are(plant.A, plant.B, wanted, np.linalg.inv(Pu))
    terms = riccati_terms(plant.A, plant.B, X, Pu, np.zeros((2, 4)))
    np.testing.assert_allclose(terms.cost, wanted, rtol=1e-8, atol=1e-8)


def test_what_has_no_fixed_point_or_no_bound_is_refused():
    with pytest.raises(ValueError, match="not positive definite"):
        steady_gain(np.array([[1.0, 0.0]]), np.eye(1), np.diag([0.0, 1.0]))
    with pytest.raises(ValueError, match="not stable"):
        ball(np.diag([0.5, 1.0]), 1.0)
