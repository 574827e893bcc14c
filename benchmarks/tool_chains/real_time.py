"""A real-time iteration: one quadratic program per step, linearised along the solution before, CasADi and OSQP."""

import casadi as ca
import numpy as np
import osqp
from scipy import sparse

from tool_chains.model import STATES, step
from tool_chains.task import Array, Decide, Task


def decide_by_osqp(task: Task) -> Decide:
    """Variables: the states 1 .. N, then the controls 0 .. N-1; the sparsity stays, the numbers are renewed."""
    steps, n = task.steps, STATES
    along = _linearised(task)
    bounds_low, bounds_high = (np.tile(b, steps) for b in (task.model.control_min, task.model.control_max))
    changes = np.tile(task.changes, steps)
    P, weights = _cost(task)
    differences = sparse.eye(4 * steps) - sparse.eye(4 * steps, k=-4)
    pattern = _dynamics(np.ones((steps, n, n)), np.ones((steps, n, 4)))
    A = sparse.bmat(
        [[pattern], [sparse.hstack([sparse.csc_matrix((4 * steps, n * steps)), sparse.eye(4 * steps)])],
         [sparse.hstack([sparse.csc_matrix((4 * steps, n * steps)), differences])]], format="csc"
    )  # fmt: skip
    # Where in A's data each entry of the dynamics lies.
    marked = A.copy()
    marked.data = np.arange(1.0, len(A.data) + 1)
    place = marked[: n * steps].toarray().astype(int) - 1
    solver = osqp.OSQP()
    size = A.shape[0]
    solver.setup(
        P, np.zeros(A.shape[1]), A, np.zeros(size), np.zeros(size), verbose=False, warm_starting=True,
        eps_abs=1e-4, eps_rel=1e-4, max_iter=4000,
    )  # fmt: skip
    guess_u: Array | None = None
    guess_x = np.zeros((n, steps))

    def decide(state: Array, now: Array, reference: Array) -> Array:
        nonlocal guess_u, guess_x
        if guess_u is None:
            guess_u, guess_x = (
                np.repeat(now[:, None], steps, axis=1),
                np.repeat(state[:, None], steps, axis=1),
            )
        before = np.column_stack([state, guess_x[:, :-1]])
        after, by_x, by_u = (np.array(value) for value in along(before, guess_u))
        by_x = by_x.reshape(n, steps, n).transpose(1, 0, 2)
        by_u = by_u.reshape(n, steps, 4).transpose(1, 0, 2)
        dense = _dynamics(by_x, by_u).toarray()
        A.data[place[place >= 0]] = dense[place >= 0]
        offset = after.T - np.einsum("kij,jk->ki", by_x, before) - np.einsum("kij,jk->ki", by_u, guess_u)
        offset[0] += by_x[0] @ state
        held = np.concatenate([now, np.zeros(4 * (steps - 1))])
        low = np.concatenate([offset.ravel(), bounds_low, held - changes])
        high = np.concatenate([offset.ravel(), bounds_high, held + changes])
        q = np.zeros(A.shape[1])
        q[n - 1 : n * steps : n] = -2.0 * reference / task.P_err
        q[n * steps : n * steps + 4] = -2.0 * weights * now
        solver.update(q=q, l=low, u=high, Ax=A.data)
        solution = solver.solve(raise_error=False).x
        guess_x = solution[: n * steps].reshape(steps, n).T
        guess_u = solution[n * steps :].reshape(steps, 4).T
        first: Array = np.clip(guess_u[:, 0], task.model.control_min, task.model.control_max)
        return first

    return decide


def _linearised(task: Task) -> ca.Function:
    """(states (10, N), controls (4, N)) -> steps and their Jacobians side by side."""
    x, u = ca.SX.sym("x", STATES), ca.SX.sym("u", 4)
    after = step(task.model)(x, u)
    one = ca.Function("one", [x, u], [after, ca.jacobian(after, x), ca.jacobian(after, u)])
    return one.map(task.steps)


def _cost(task: Task) -> tuple[sparse.csc_matrix, Array]:
    """Twice the weights of the squares, upper triangle, and the weights of the changes."""
    steps, weights = task.steps, task.change_weights
    errors = np.zeros(STATES * steps)
    errors[STATES - 1 :: STATES] = 1.0 / task.P_err
    differences = sparse.eye(4 * steps) - sparse.eye(4 * steps, k=-4)
    changes = differences.T @ sparse.diags(np.tile(weights, steps)) @ differences
    return sparse.triu(2.0 * sparse.block_diag([sparse.diags(errors), changes]), format="csc"), weights


def _dynamics(by_x: Array, by_u: Array) -> sparse.csc_matrix:
    """Rows x_k+1 - A_k x_k - B_k u_k, with x_0 known."""
    steps, n = by_x.shape[:2]
    states = sparse.lil_matrix((n * steps, n * steps))
    controls = sparse.lil_matrix((n * steps, 4 * steps))
    for k in range(steps):
        rows = slice(n * k, n * (k + 1))
        states[rows, rows] = np.eye(n)
        if k > 0:
            states[rows, n * (k - 1) : n * k] = -by_x[k]
        controls[rows, 4 * k : 4 * (k + 1)] = -by_u[k]
    return sparse.csc_matrix(sparse.hstack([states, controls]))
