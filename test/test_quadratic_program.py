"""The quadratic program against SciPy and against its optimality conditions."""

import numpy as np
import pytest
from scipy.optimize import LinearConstraint, lsq_linear, minimize

from skydiver_utc.control.quadratic_program import Rows, make_scratch, solve_quadratic_program


def solved(H, g, rows, start=None):
    x = np.zeros(len(g)) if start is None else np.array(start)
    iterations = solve_quadratic_program(H, g, rows, x, make_scratch(len(g), len(rows.lower)))
    return x, iterations


def box(lower, upper):
    n = len(lower)
    return Rows(np.arange(n), np.full(n, -1), np.asarray(lower, float), np.asarray(upper, float))


def random_program(generator, n):
    """A badly scaled convex objective: columns over four decades, the gradient over six."""
    root = generator.normal(size=(n + 2, n)) * 10 ** generator.uniform(-2, 2, n)
    return root.T @ root + 1e-6 * np.eye(n), generator.normal(size=n) * 10 ** generator.uniform(-3, 3)


@pytest.mark.parametrize("seed", range(60))
def test_bounds_alone_agree_with_bounded_least_squares(seed):
    generator = np.random.default_rng(seed)
    n = int(generator.integers(1, 12))
    H, g = random_program(generator, n)
    lower, upper = -generator.uniform(0, 1, n), generator.uniform(0.01, 1, n)
    x, iterations = solved(H, g, box(lower, upper))
    factor = np.linalg.cholesky(H)
    expected = lsq_linear(
        factor.T, -np.linalg.solve(factor, g), (lower, upper), method="bvls", tol=1e-15, max_iter=1000
    )
    assert 0 <= iterations < 30
    np.testing.assert_allclose(x, expected.x, atol=1e-7)
    # What pushes against its bound is on it, to the bit.
    gradient = H @ x + g
    pushed = np.abs(gradient) > 1e-6 * np.abs(g).max()
    assert ((x == lower) | (x == upper))[pushed].all()


@pytest.mark.parametrize("seed", range(30))
def test_bounds_and_differences_agree_with_sequential_quadratic_programming(seed):
    generator = np.random.default_rng(seed)
    n = int(generator.integers(3, 10))
    root = generator.normal(size=(n + 2, n))
    H, g = root.T @ root + 0.1 * np.eye(n), 5.0 * generator.normal(size=n)
    lower, upper = np.full(n, -1.0), generator.uniform(0.1, 1, n)
    rate = generator.uniform(0.05, 0.3, n - 1)
    rows = Rows(
        np.concatenate([np.arange(n), np.arange(1, n)]),
        np.concatenate([np.full(n, -1), np.arange(n - 1)]),
        np.concatenate([lower, -rate]),
        np.concatenate([upper, rate]),
    )
    x, iterations = solved(H, g, rows)
    assert iterations >= 0
    expected = minimize(
        lambda v: 0.5 * v @ H @ v + g @ v,
        np.zeros(n),
        jac=lambda v: H @ v + g,
        method="SLSQP",
        bounds=list(zip(lower, upper, strict=True)),
        constraints=LinearConstraint(np.diff(np.eye(n), axis=0), -rate, rate),
        options={"ftol": 1e-14, "maxiter": 1000},
    )
    assert (np.abs(np.diff(x)) <= rate + 1e-9).all()
    assert 0.5 * x @ H @ x + g @ x <= expected.fun + 1e-9
    np.testing.assert_allclose(x, expected.x, atol=1e-5)


def test_without_bounds_it_is_a_linear_solve():
    generator = np.random.default_rng(3)
    H, g = random_program(generator, 5)
    x, _ = solved(H, g, box(np.full(5, -np.inf), np.full(5, np.inf)))
    np.testing.assert_allclose(x, np.linalg.solve(H, -g), rtol=1e-7)


def test_a_bound_on_one_side_only():
    x, _ = solved(np.eye(2), np.array([-3.0, 3.0]), box([-np.inf, -np.inf], [1.0, np.inf]))
    np.testing.assert_allclose(x, [1.0, -3.0], atol=1e-9)


def test_a_start_at_the_minimiser_stays_there():
    generator = np.random.default_rng(5)
    H, g = random_program(generator, 6)
    rows = box(np.full(6, -0.1), np.full(6, 0.1))
    x, _ = solved(H, g, rows)
    again, iterations = solved(H, g, rows, start=x)
    assert iterations >= 0
    np.testing.assert_allclose(again, x, atol=1e-7)


def test_a_start_outside_the_bounds_is_no_matter():
    x, _ = solved(np.eye(2), np.array([-0.5, 3.0]), box([-1, -1], [1, 1]), start=[40.0, -7.0])
    np.testing.assert_allclose(x, [0.5, -1.0], atol=1e-9)


@pytest.mark.parametrize(
    ("H", "g"),
    [
        (np.eye(2), np.array([np.nan, 0.0])),
        (np.eye(2), np.array([np.inf, 0.0])),
        (np.array([[np.nan, 0.0], [0.0, 1.0]]), np.ones(2)),
        (np.diag([1.0, np.inf]), np.ones(2)),
        (-np.eye(2), np.ones(2)),
    ],
    ids=["nan", "inf", "nan_matrix", "inf_matrix", "concave"],
)
def test_without_a_finite_solution_it_says_so(H, g):
    unbounded = np.full(2, np.inf)
    assert solved(H, g, box(-unbounded, unbounded), start=[2.0, 3.0])[1] == -1
