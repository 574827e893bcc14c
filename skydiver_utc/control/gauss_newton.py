"""Nonlinear model predictive control by Gauss-Newton steps, for any plant given as a roll-out.

Single shooting: the outputs are linearised in the control sequence by one-sided differences (one roll-out for
the sequence at hand, one for each of its entries), and the quadratic program of J (`control/horizon.py`) under
magnitude and rate limits gives the next sequence, in full steps. One iteration per decision, started from the
sequence before, is the real-time iteration (Diehl, Bock, Schloeder, SIAM J. Control Optim. 43 (2005) 1714-1736).
"""

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.control.horizon import (
    Horizon,
    HorizonCost,
    RollOut,
    cost_of,
    first_period,
    one_period_on,
)
from skydiver_utc.control.limits import ControlLimits
from skydiver_utc.control.protocol import Decision, Status
from skydiver_utc.control.quadratic_program import Rows, make_scratch, solve_quadratic_program
from skydiver_utc.jit import kernel

Array = NDArray[np.float64]

# Difference for the derivatives, as a share of a control's range.
_DIFFERENCE = 1e-5


class GaussNewtonController:
    """Keeps a control sequence and improves it at each decision."""

    telemetry_names: tuple[str, ...] = ("predicted_output", "predicted_error", "cost", "program_iterations")

    def __init__(
        self,
        roll_out: RollOut,
        limits: ControlLimits,
        horizon: Horizon,
        cost: HorizonCost,
        initial: Array,
        iterations: int = 1,
    ) -> None:
        m, n = len(initial), horizon.blocks * len(initial)
        self._roll_out, self._limits, self._horizon, self._cost = roll_out, limits, horizon, cost
        self._initial, self._iterations = initial, iterations
        self._rows = _limit_rows(limits, horizon)
        self._scratch = make_scratch(n, len(self._rows.lower))
        self._differences = np.tile(_DIFFERENCE * (limits.maximum - limits.minimum), horizon.blocks)
        self._candidates = np.empty((n + 1, horizon.blocks, m))
        self._outputs = np.empty((n + 1, horizon.steps))
        self._H, self._g = np.empty((n, n)), np.empty(n)
        self.preview_steps = horizon.preview_steps
        self.reset()

    def reset(self) -> None:
        """Start again from the initial control."""
        self.resume(self._initial)

    def resume(self, control: Array) -> None:
        """Start from this control, the one applied last, held over the horizon."""
        self._applied = control.copy()
        self._sequence = np.tile(control, (self._horizon.blocks, 1))

    def decide(self, state: Array, preview: Array) -> Decision:
        """Improve the sequence and take its first control."""
        reference = self._horizon.reference(preview)
        solution = self._sequence.copy()
        program_iterations = 0
        for _ in range(self._iterations):
            used = self._improve(state, reference, solution)
            if used < 0:
                return self._keep_previous()
            program_iterations += used
        predicted = float(self._outputs[0, -1])
        error = float(reference[-1]) - predicted
        cost = cost_of(self._candidates[0], self._applied, self._outputs[0], reference, self._cost)
        at_limit = (solution[0] == self._rows.lower[: len(self._applied)]) | (
            solution[0] == self._rows.upper[: len(self._applied)]
        )
        control = first_period(solution, self._applied, self._limits, self._horizon)
        self._applied = control
        self._sequence = one_period_on(solution, self._horizon)
        status = Status.SATURATED if at_limit.any() else Status.SOLVED
        return Decision(control.copy(), np.array([predicted, error, cost, float(program_iterations)]), status)

    def _improve(self, state: Array, reference: Array, solution: Array) -> int:
        """One Gauss-Newton step on a sequence (B, m); the program's iterations, or -1 where it has no solution."""
        m = len(self._applied)
        differ(solution, self._differences, self._limits.maximum, self._candidates)
        self._roll_out(state, self._applied, self._candidates, self._outputs)
        linearise_cost(
            self._candidates, self._outputs, reference, self._applied, self._cost, self._H, self._g
        )
        allowed = self._limits.slew * self._horizon.block_periods
        self._rows.lower[:m] = np.maximum(self._limits.minimum, self._applied - allowed)
        self._rows.upper[:m] = np.minimum(self._limits.maximum, self._applied + allowed)
        return solve_quadratic_program(self._H, self._g, self._rows, solution.reshape(-1), self._scratch)

    def _keep_previous(self) -> Decision:
        """The control before, and a fresh start from it: the sequence led where the model has no finite answer."""
        self._sequence = np.tile(self._applied, (self._horizon.blocks, 1))
        return Decision(self._applied.copy(), np.zeros(len(self.telemetry_names)), Status.KEPT_PREVIOUS)


def _limit_rows(limits: ControlLimits, horizon: Horizon) -> Rows:
    """Magnitudes of all entries, then the changes between neighbouring blocks of what has a rate limit."""
    m, blocks = len(limits.minimum), horizon.blocks
    moving = np.flatnonzero(np.isfinite(limits.slew))
    later = (m * np.arange(1, blocks)[:, None] + moving).ravel()
    change = np.tile(limits.slew[moving] * horizon.block_periods, blocks - 1)
    return Rows(
        plus=np.concatenate([np.arange(m * blocks), later]).astype(np.int64),
        minus=np.concatenate([np.full(m * blocks, -1), later - m]).astype(np.int64),
        lower=np.concatenate([np.tile(limits.minimum, blocks), -change]),
        upper=np.concatenate([np.tile(limits.maximum, blocks), change]),
    )


@kernel
def differ(sequence: Array, differences: Array, maximum: Array, candidates: Array) -> None:
    """The sequence (B, m) and, one by one, each entry moved by its difference, to candidates (B m + 1, B, m).

    An entry too near to its maximum moves down.
    """
    m = sequence.shape[1]
    for i in range(candidates.shape[0]):
        candidates[i, :, :] = sequence
        if i > 0:
            b, c = (i - 1) // m, (i - 1) % m
            step = differences[i - 1]
            candidates[i, b, c] += step if sequence[b, c] + step <= maximum[c] else -step


@kernel
def linearise_cost(
    candidates: Array, outputs: Array, reference: Array, applied: Array, cost: HorizonCost, H: Array, g: Array
) -> None:
    """H (n, n) and g (n,) of J / 2 = 1/2 x' H x + g' x + const in the sequence's entries x, outputs linearised.

    outputs (n + 1, N) is overwritten by derivatives from its second row on.
    """
    blocks, m, steps = candidates.shape[1], candidates.shape[2], reference.shape[0]
    n = blocks * m
    for i in range(n):
        b, c = i // m, i % m
        step = candidates[i + 1, b, c] - candidates[0, b, c]
        for j in range(steps):
            outputs[i + 1, j] = (outputs[i + 1, j] - outputs[0, j]) / step
    for i in range(n):
        g[i] = 0.0
        for k in range(i + 1):
            total = 0.0
            for j in range(steps):
                total += outputs[i + 1, j] * outputs[k + 1, j]
            H[i, k] = total / steps
            H[k, i] = H[i, k]
    # The tracking gradient at x is J' (y - r); as the gradient at zero, J' (y - r - J x).
    for j in range(steps):
        error = outputs[0, j] - reference[j]
        for i in range(n):
            error -= outputs[i + 1, j] * candidates[0, i // m, i % m]
        for i in range(n):
            g[i] += outputs[i + 1, j] * error / steps
    for i in range(n):
        c = i % m
        control, change = cost.control[c] / blocks, cost.change[c] / blocks
        H[i, i] += control + change
        g[i] -= control * cost.rest[c]
        if i < m:
            g[i] -= change * applied[c]
        else:
            H[i - m, i - m] += change
            H[i, i - m] -= change
            H[i - m, i] -= change
