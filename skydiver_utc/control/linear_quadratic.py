"""A linear-quadratic regulator that tracks a previewed reference, for any plant linearised about an equilibrium.

For deviations z of the state and u of the control from the equilibrium, z' = A z + B u and y = C z per control
period, it minimises without regard to limits and over an infinite time

    sum_k (y_k - r_k)^2 + sum_c w_c u_k,c^2 + sum_c s_c (u_k,c - u_k-1,c)^2

With xi = (z, u_k-1), the change of the control is -K xi + sum_j F_j r_k+j: K from the discrete Riccati equation,
F_j from the adjoint of the closed loop. The reference counts as constant after its last known value. The control
before is the one that the limits left, so that a control at its limit does not wind up.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.control.limits import ControlLimits
from skydiver_utc.control.protocol import Decision, Status

Array = NDArray[np.float64]


class Equilibrium(NamedTuple):
    """State z (n,) and control (m,) about which A (n, n), B (n, m) and C (n,) are the linearised plant."""

    state: Array
    control: Array
    A: Array
    B: Array
    C: Array


class Gains(NamedTuple):
    """K (m, n + m) on the state and the control before, F (m, N) on r_1 .. r_N."""

    feedback: Array
    preview: Array


def design(plant: Equilibrium, control_weight: Array, change_weight: Array, preview_steps: int) -> Gains:
    """Gains for the weights w and s, each (m,) and positive."""
    from scipy.linalg import solve_discrete_are

    n, m = plant.B.shape
    A = np.block([[plant.A, plant.B], [np.zeros((m, n)), np.eye(m)]])
    B = np.vstack([plant.B, np.eye(m)])
    C = np.append(plant.C, np.zeros(m))
    Q = np.outer(C, C) + np.diag(np.append(np.zeros(n), control_weight))
    R = np.diag(change_weight)
    P = solve_discrete_are(A, B, Q, R)
    to_change = np.linalg.solve(R + B.T @ P @ B, B.T)
    feedback = to_change @ P @ A
    closed = (A - B @ feedback).T
    columns = []
    pull = C
    for _ in range(preview_steps - 1):
        columns.append(to_change @ pull)
        pull = closed @ pull
    columns.append(to_change @ np.linalg.solve(np.eye(n + m) - closed, pull))
    return Gains(feedback, np.column_stack(columns))


class LinearQuadraticController:
    """Flies the gains; `measure` gives z (n,) of a state."""

    telemetry_names: tuple[str, ...] = ("error", "beyond_limits")

    def __init__(
        self,
        measure: Callable[[Array], Array],
        plant: Equilibrium,
        gains: Gains,
        limits: ControlLimits,
        initial: Array,
    ) -> None:
        self._measure, self._plant, self._gains = measure, plant, gains
        self._limits, self._initial = limits, initial
        self._output_at_rest = float(plant.C @ plant.state)
        self.preview_steps = gains.preview.shape[1]
        self.reset()

    def reset(self) -> None:
        """Start again from the initial control."""
        self.resume(self._initial)

    def resume(self, control: Array) -> None:
        """Start from this control, the one applied last."""
        self._applied = control.copy()

    def decide(self, state: Array, preview: Array) -> Decision:
        """u_k = u_k-1 - K xi + F r, then the limits."""
        z = self._measure(state) - self._plant.state
        xi = np.concatenate([z, self._applied - self._plant.control])
        reference = preview - self._output_at_rest
        wanted = self._applied - self._gains.feedback @ xi + self._gains.preview @ reference[1:]
        if not np.isfinite(wanted).all():
            return Decision(self._applied.copy(), np.zeros(len(self.telemetry_names)), Status.KEPT_PREVIOUS)
        control = self._limits.apply(wanted, self._applied)
        self._applied = control
        error = float(reference[0] - self._plant.C @ z)
        status = Status.SOLVED if (control == wanted).all() else Status.SATURATED
        return Decision(control.copy(), np.array([error, np.abs(wanted - control).max()]), status)
