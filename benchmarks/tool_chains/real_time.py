# SPDX-License-Identifier: Apache-2.0
"""A real-time iteration: one quadratic program per decision, linearised by CasADi, condensed, solved by OSQP."""

import numpy as np
import osqp
from scipy import sparse

from tool_chains.program import Array, Program, Solution, Solve
from tool_chains.roll_out import linearised

# Of the yaw rate for a control's whole range [rad/s]; beyond it the model has diverged.
_LARGEST_DERIVATIVE = 1e6
_SETTINGS = {
    "verbose": False,
    "warm_starting": True,
    "eps_abs": 1e-6,
    "eps_rel": 1e-6,
    "max_iter": 4000,
    "adaptive_rho_interval": 50,  # in iterations: by the clock, no two flights would be the same
}


def solve_by_osqp(program: Program) -> Solve:
    """The variables are the sequence in shares of the controls' ranges."""
    steps, blocks = program.structure.steps, program.structure.blocks
    n, least, ranges = 4 * blocks, program.minimum, program.maximum - program.minimum
    minimum, width = np.tile(least, blocks), np.tile(ranges, blocks)
    linear = linearised(program.structure)
    curvature, pull, on_first = _effort(program)
    steering = np.arange(3, n, 4)
    change = np.eye(n)[steering] - np.eye(n, k=-4)[steering]
    A = sparse.csc_matrix(np.vstack([np.eye(n), change]))
    upper = np.triu_indices(n)
    by_column = np.lexsort(upper)
    rows, columns = upper[0][by_column], upper[1][by_column]
    P = sparse.csc_matrix((np.ones(len(rows)), (rows, columns)), shape=(n, n))
    allowed = np.full(blocks, program.change / width[3])

    def fresh() -> osqp.OSQP:
        solver = osqp.OSQP()
        solver.setup(P, np.zeros(n), A, np.zeros(n + blocks), np.ones(n + blocks), **_SETTINGS)
        return solver

    solver = fresh()

    def solve(state: Array, now: Array, reference: Array, start: Array) -> Solution:
        nonlocal solver
        rates, by_control = linear(state, now, start.T, program.periods)
        by_share = np.array(by_control) * width
        if not np.abs(by_share).max() < _LARGEST_DERIVATIVE:
            return Solution(start, 0, False)
        at = (start.ravel() - minimum) / width
        residual = np.array(rates).ravel() - reference - by_share @ at
        H = 2.0 * (by_share.T @ by_share / steps + curvature)
        q = 2.0 * (by_share.T @ residual / steps - pull)
        now_shares = (now - least) / ranges
        q[:4] -= 2.0 * on_first * now_shares
        held = np.append(now_shares[3], np.zeros(blocks - 1))
        low, high = np.append(np.zeros(n), held - allowed), np.append(np.ones(n), held + allowed)
        solver.update(Px=H[rows, columns], q=q, l=low, u=high)
        result = solver.solve(raise_error=False)
        found = result.info.status_val == osqp.SolverStatus.OSQP_SOLVED
        if not found:
            solver = fresh()  # of a failure its memory keeps something
        sequence = (minimum + result.x * width).reshape(blocks, 4)
        return Solution(sequence, int(result.info.iter), bool(found))

    return solve


def _effort(program: Program) -> tuple[Array, Array, Array]:
    """Of the cost on controls and changes: half the Hessian (n, n) by shares, the pull to rest (n,), and the weight
    (4,) with which the control applied last pulls the first one.
    """
    cost, blocks = program.cost, program.structure.blocks
    width = program.maximum - program.minimum
    control, change = (np.tile(c * width**2 / blocks, blocks) for c in (cost.control, cost.change))
    differences = np.eye(4 * blocks) - np.eye(4 * blocks, k=-4)
    curvature = np.diag(control) + differences.T @ np.diag(change) @ differences
    nominal = np.tile((cost.nominal - program.minimum) / width, blocks)
    return curvature, control * nominal, change[:4]
