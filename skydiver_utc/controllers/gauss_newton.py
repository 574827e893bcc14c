# SPDX-License-Identifier: Apache-2.0
"""Nonlinear model predictive control by Gauss-Newton steps, for any plant.

Single shooting: the outputs are linearised in the control sequence by one-sided differences (one roll-out for
the sequence at hand, one for each of its entries), and the quadratic program of J (`controllers/horizon.py`) under
magnitude and rate limits gives the next sequence, in full steps. One iteration per decision, started from the
sequence before, is the real-time iteration (Diehl, Bock, Schloeder, SIAM J. Control Optim. 43 (2005) 1714-1736).
"""

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.horizon import SequenceController
from skydiver_utc.controllers.protocol import Decision, Status
from skydiver_utc.controllers.settings import GaussNewtonSettings
from skydiver_utc.plants.protocol import Plant

# Difference for the derivatives, as a share of a control's range.
_DIFFERENCE = 1e-5
_TOLERANCE = 1e-9


class GaussNewtonController(SequenceController):
    """Keeps a control sequence and improves it at each decision."""

    telemetry_names: tuple[str, ...] = ("predicted_error", "cost", "program_iterations")

    def __init__(
        self,
        settings: GaussNewtonSettings,
        plant: Plant,
        outputs: tuple[str, ...],
        dt_s: float,
        seed: int = 0,
    ) -> None:
        m, blocks = len(plant.control_names), settings.blocks
        n = blocks * m
        super().__init__(settings, plant, outputs, n + 1)
        self._iterations = settings.iterations
        self._horizon.begin[1:] = np.repeat(np.arange(blocks), m) * self._horizon.hold
        minimum, maximum, change = self._horizon.limits
        self._differences = np.tile(_DIFFERENCE * (maximum - minimum), blocks)
        # Rows of the program: bounds of the entries, then changes between neighbouring blocks of what has a rate.
        moving = np.flatnonzero(np.isfinite(change))
        changes = np.eye(n + m, n) - np.eye(n + m, n, k=-m)
        self._rows = changes[(m * np.arange(1, blocks)[:, None] + moving).ravel()]
        allowed = np.tile(change[moving] * self._horizon.block_periods, blocks - 1)
        self._lower = np.concatenate([np.tile(minimum, blocks), -allowed])
        self._upper = np.concatenate([np.tile(maximum, blocks), allowed])
        self._points = self._horizon.sequences.reshape(n + 1, n)
        self._moved = np.einsum("ii->i", self._points[1:])  # a view of the entry that each sequence changes
        # The cost of controls and changes in the program: in H, and in g.
        control, self._change = self._cost.control / blocks, self._cost.change / blocks
        of_changes = changes.T * np.tile(self._change, blocks + 1) @ changes
        self._curvature = np.diag(np.tile(control, blocks)) + of_changes
        self._curvature[-m:, -m:] -= np.diag(self._change)  # nothing changes after the last block
        self._pull = np.tile(control * self._cost.nominal, blocks)
        self.reset()

    def decide(self, state: Array, preview: Array) -> Decision:
        """Improve the sequence and take its first control."""
        at, reference = self._horizon, self._horizon.reference(preview)
        solution, iterations = self._sequence, 0
        for _ in range(self._iterations):
            found = self._improve(state, preview, reference, solution)
            if found is None:
                return self._kept()
            solution, saturated, used = found
            iterations += used
        error = float(np.hypot.reduce(reference[-1] - self._outputs[-reference.shape[1] :], initial=0.0))
        cost = float(
            self._cost.of(
                at.sequences[:1], self._previous, self._outputs[None], np.ascontiguousarray(reference)
            )[0]
        )
        self._previous = at.first_period(solution, self._previous)
        self._sequence = at.one_period_on(solution)
        status = Status.SATURATED if saturated else Status.SOLVED
        return Decision(self._previous.copy(), np.array([error, cost, float(iterations)]), status)

    def _improve(
        self, state: Array, preview: Array, reference: Array, sequence: Array
    ) -> tuple[Array, bool, int] | None:
        """One Gauss-Newton step on a sequence (B, m): the next, whether its first control is limited, iterations."""
        import daqp

        at, m, n = self._horizon, len(self._previous), sequence.size
        minimum, maximum, change = at.limits
        x = sequence.ravel()
        self._points[:] = x
        # An entry too near to its maximum moves down.
        up = x + self._differences <= self._upper[:n]
        self._moved += np.where(up, self._differences, -self._differences)
        outputs = at.outputs(state, self._previous, preview)
        self._outputs = outputs[0].copy()
        J = (outputs[1:] - outputs[0]) / (self._moved - x)[:, None]
        # J / 2 = 1/2 x' H x + g' x + const, the outputs linearised.
        error, steps = outputs[0] - reference.ravel() - x @ J, len(reference)
        with np.errstate(over="ignore", invalid="ignore"):  # of a model that diverges
            H, g = J @ J.T / steps, J @ error / steps
        H += self._curvature
        g -= self._pull
        g[:m] -= self._change * self._previous
        if not (np.isfinite(H).all() and np.isfinite(g).all()):
            return None
        lower, upper = self._lower.copy(), self._upper.copy()
        allowed = change * at.block_periods
        lower[:m] = np.maximum(minimum, self._previous - allowed)
        upper[:m] = np.minimum(maximum, self._previous + allowed)
        sense = np.zeros(len(lower), dtype=np.int32)
        found, _, flag, details = daqp.solve(H, g, self._rows, upper, lower, sense, primal_tol=_TOLERANCE)
        if flag <= 0:
            return None
        solution = np.clip(found, lower[:n], upper[:n]).reshape(sequence.shape)
        first = found[:m]
        limited = (first <= lower[:m] + _TOLERANCE) | (first >= upper[:m] - _TOLERANCE)
        return solution, bool(limited.any()), int(details["iterations"])
