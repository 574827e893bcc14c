"""A small convex quadratic program with bounds on variables and on differences of two variables.

    minimise 1/2 x' H x + g' x   subject to   lower_k <= x[plus_k] - x[minus_k] <= upper_k

A row with minus_k = -1 bounds the variable x[plus_k] itself. Magnitude and rate limits of a control sequence need
no more, and every row has one or two entries. Solved by the primal-dual interior-point method with Mehrotra's
predictor and corrector (Nocedal and Wright, Numerical Optimization, algorithm 16.4), each row with a slack s and a
force z on its lower and on its upper side.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.jit import kernel
from skydiver_utc.unscented.linear_algebra import cholesky, divide_by_lower, divide_by_upper

Array = NDArray[np.float64]

_MOST_ITERATIONS = 60
# Relative to the scale of the forces. Rounding leaves about 1e-11 of the gradient once slacks are small.
_LARGEST_RESIDUAL = 1e-9
_LARGEST_COMPLEMENTARITY = 1e-12
_SHARE_OF_REACH = 0.995


class Rows(NamedTuple):
    """The constraints: indices (k,) and bounds (k,); an infinite bound is none."""

    plus: NDArray[np.int64]
    minus: NDArray[np.int64]
    lower: Array
    upper: Array


class Scratch(NamedTuple):
    """Work space: factor (n, n), gradient (n,), step (1, n); for both sides of the rows (2, k) slack and force,
    their steps, the slack's error (gap), by how much slack times force is to change (target), the push on the rows.
    """

    factor: Array
    gradient: Array
    step: Array
    slack: Array
    force: Array
    slack_step: Array
    force_step: Array
    gap: Array
    target: Array
    push: Array


def make_scratch(variables: int, rows: int) -> Scratch:
    """Work space, so that no solution allocates."""
    sides = (np.zeros((2, rows)) for _ in range(7))
    return Scratch(np.empty((variables, variables)), np.empty(variables), np.empty((1, variables)), *sides)


@kernel
def solve_quadratic_program(H: Array, g: Array, rows: Rows, x: Array, s: Scratch) -> int:
    """Write the minimiser to x (n,), which holds the starting point; H (n, n) is positive definite.

    Returns the iterations used, or -1 without a finite solution. A variable whose own bound pushes is set on it.
    """
    scale = _start(H, g, rows, x, s)
    if not scale < np.inf:
        return -1
    for iteration in range(_MOST_ITERATIONS):
        worst, complementarity = _residuals(H, g, rows, x, scale, s)
        if worst <= _LARGEST_RESIDUAL and complementarity <= _LARGEST_COMPLEMENTARITY * scale:
            _set_on_active_bounds(rows, scale, x, s)
            return iteration
        if not _factorise(H, rows, s):
            return -1
        reach = 0.0
        for corrected in range(2):
            aim = 0.0
            if corrected == 1 and complementarity > 0.0:
                aim = (_complementarity(reach, s) / complementarity) ** 3 * complementarity
            reach = _direction(rows, aim, corrected == 1, s)
        reach = min(1.0, _SHARE_OF_REACH * reach)
        for i in range(x.shape[0]):
            x[i] += reach * s.step[0, i]
        for side in range(2):
            for r in range(rows.lower.shape[0]):
                s.slack[side, r] += reach * s.slack_step[side, r]
                s.force[side, r] += reach * s.force_step[side, r]
    return -1


@kernel
def _start(H: Array, g: Array, rows: Rows, x: Array, s: Scratch) -> float:
    """Slacks and forces to start from; returns the scale of all forces, the largest sum of the gradient's terms.

    The gradient itself will not do: it is zero where the start is the minimiser.
    """
    scale = 1e-300
    for i in range(x.shape[0]):
        total = abs(g[i])
        for j in range(x.shape[0]):
            total += abs(H[i, j] * x[j])
        # A comparison, for np.isfinite is x - x == 0, which the compiler may fold for a sum.
        scale = max(scale, total) if total < np.inf else np.inf
    for r in range(rows.lower.shape[0]):
        width = rows.upper[r] - rows.lower[r]
        least = 0.01 * width if width < np.inf else 0.01
        for side in range(2):
            limited = abs(rows.lower[r] if side == 0 else rows.upper[r]) < np.inf
            s.slack[side, r] = max(_room(rows, x, side, r), least) if limited else 1.0
            # A side without a bound keeps the force zero throughout.
            s.force[side, r] = scale if limited else 0.0
    return scale


@kernel
def _residuals(H: Array, g: Array, rows: Rows, x: Array, scale: float, s: Scratch) -> tuple[float, float]:
    """Gradient of the Lagrangian and gaps of the slacks; the largest of both, and the complementarity."""
    worst = 0.0
    for i in range(x.shape[0]):
        s.gradient[i] = g[i]
        for j in range(x.shape[0]):
            s.gradient[i] += H[i, j] * x[j]
    for r in range(rows.lower.shape[0]):
        _add_to_row(rows, s.force[1, r] - s.force[0, r], r, s.gradient)
        for side in range(2):
            s.gap[side, r] = 0.0
            if s.force[side, r] > 0.0:
                s.gap[side, r] = _room(rows, x, side, r) - s.slack[side, r]
                worst = max(worst, abs(s.gap[side, r]))
    for i in range(x.shape[0]):
        worst = max(worst, abs(s.gradient[i]) / scale)
    return worst, _complementarity(-1.0, s)


@kernel
def _complementarity(reach: float, s: Scratch) -> float:
    """Mean of slack times force, after a share of the step if `reach` is not negative."""
    total, count = 0.0, 0
    share = max(reach, 0.0)
    for side in range(2):
        for r in range(s.slack.shape[1]):
            if s.force[side, r] > 0.0:
                total += (s.slack[side, r] + share * s.slack_step[side, r]) * (
                    s.force[side, r] + share * s.force_step[side, r]
                )
                count += 1
    return total / max(count, 1)


@kernel
def _factorise(H: Array, rows: Rows, s: Scratch) -> bool:
    """Cholesky factor of H + A' diag(z/s) A; False if it is not positive definite."""
    s.factor[:, :] = H
    for r in range(rows.lower.shape[0]):
        weight = s.force[0, r] / s.slack[0, r] + s.force[1, r] / s.slack[1, r]
        p, q = rows.plus[r], rows.minus[r]
        s.factor[p, p] += weight
        if q >= 0:
            s.factor[q, q] += weight
            s.factor[p, q] -= weight
            s.factor[q, p] -= weight
    return cholesky(s.factor)


@kernel
def _direction(rows: Rows, aim: float, second_order: bool, s: Scratch) -> float:
    """Newton's step towards slack times force = aim; returns the share of it that keeps all of them positive."""
    for side in range(2):
        for r in range(rows.lower.shape[0]):
            s.target[side, r], s.push[side, r] = 0.0, 0.0
            if s.force[side, r] > 0.0:
                product = s.slack_step[side, r] * s.force_step[side, r] if second_order else 0.0
                s.target[side, r] = aim - s.slack[side, r] * s.force[side, r] - product
                s.push[side, r] = (s.target[side, r] - s.force[side, r] * s.gap[side, r]) / s.slack[side, r]
    for i in range(s.gradient.shape[0]):
        s.step[0, i] = -s.gradient[i]
    for r in range(rows.lower.shape[0]):
        _add_to_row(rows, s.push[0, r] - s.push[1, r], r, s.step[0])
    divide_by_upper(s.step, s.factor)
    divide_by_lower(s.step, s.factor)
    reach = 1.0
    for side in range(2):
        for r in range(rows.lower.shape[0]):
            s.slack_step[side, r], s.force_step[side, r] = 0.0, 0.0
            if s.force[side, r] > 0.0:
                change = _of_row(rows, s.step[0], r)
                inwards = s.gap[side, r] + (change if side == 0 else -change)
                pushed = (s.target[side, r] - s.force[side, r] * inwards) / s.slack[side, r]
                if inwards < 0.0:
                    reach = min(reach, -s.slack[side, r] / inwards)
                if pushed < 0.0:
                    reach = min(reach, -s.force[side, r] / pushed)
                s.slack_step[side, r], s.force_step[side, r] = inwards, pushed
    return reach


@kernel
def _of_row(rows: Rows, x: Array, r: int) -> float:
    """x[plus] - x[minus] of one row."""
    value: float = x[rows.plus[r]]
    if rows.minus[r] >= 0:
        value -= x[rows.minus[r]]
    return value


@kernel
def _add_to_row(rows: Rows, value: float, r: int, out: Array) -> None:
    """Add a multiple of one row to out (n,)."""
    out[rows.plus[r]] += value
    if rows.minus[r] >= 0:
        out[rows.minus[r]] -= value


@kernel
def _room(rows: Rows, x: Array, side: int, r: int) -> float:
    """Distance of one row from its lower (side 0) or upper bound."""
    value = _of_row(rows, x, r)
    room: float = value - rows.lower[r] if side == 0 else rows.upper[r] - value
    return room


@kernel
def _set_on_active_bounds(rows: Rows, scale: float, x: Array, s: Scratch) -> None:
    """The iteration ends a hair inside a bound that pushes."""
    for r in range(rows.lower.shape[0]):
        if rows.minus[r] < 0:
            if s.force[0, r] / scale > s.slack[0, r]:
                x[rows.plus[r]] = rows.lower[r]
            elif s.force[1, r] / scale > s.slack[1, r]:
                x[rows.plus[r]] = rows.upper[r]
