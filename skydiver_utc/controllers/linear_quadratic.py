# SPDX-License-Identifier: Apache-2.0
"""A linear-quadratic regulator that tracks a previewed reference, for any plant, linearised about its equilibrium.

For deviations z of the state and u of the control from the equilibrium, z' = A z + B u and y = C z per control
period, it minimises without regard to limits and over an infinite time

    sum_k |y_k - r_k|^2 + sum_c w_c u_k,c^2 + sum_c s_c (u_k,c - u_k-1,c)^2

With xi = (z, u_k-1), the change of the control is -K xi + sum_j F_j r_k+j: K from the discrete Riccati equation,
F_j from the adjoint of the closed loop. The reference counts as constant after its last known value. The control
before is the one that the limits left, so that a control at its limit does not wind up.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.horizon import HorizonCost, cost_of
from skydiver_utc.controllers.limits import LimitedController, limit
from skydiver_utc.controllers.protocol import Decision, Status
from skydiver_utc.controllers.settings import LqrSettings
from skydiver_utc.jit import by_address, unfused
from skydiver_utc.plants.protocol import Plant, Reduced

_DIFFERENCE = 1e-5
_STATUS = tuple(Status)
# Literals for the program.
_SOLVED, _SATURATED, _KEPT_PREVIOUS = int(Status.SOLVED), int(Status.SATURATED), int(Status.KEPT_PREVIOUS)


class Linearised(NamedTuple):
    """A (n, n), B (n, m) of one step and C (l, n) about an equilibrium, with the outputs there (l,)."""

    A: Array
    B: Array
    C: Array
    outputs: Array


def linearised(plant: Plant, about: Reduced, control: Array, outputs: tuple[str, ...]) -> Linearised:
    """The plant's model about an equilibrium in its reduced state; central differences."""
    model, selected = plant.bound_model, [plant.output_names.index(name) for name in outputs]
    following, values = np.empty(plant.model.state_size), np.empty(len(plant.output_names))
    n, base = len(about.state), np.append(about.state, control)

    def step(at: Array) -> Array:
        model.step(about.expand(at[:n]), at[n:], following)
        return about.reduce(following.copy())

    def output(at: Array) -> Array:
        model.outputs(about.expand(at[:n]), values)
        return values[selected].copy()

    def slopes(of: Callable[[Array], Array]) -> Array:
        columns = []
        for i, size in enumerate(_DIFFERENCE * np.maximum(1.0, np.abs(base))):
            ahead, back = base.copy(), base.copy()
            ahead[i] += size
            back[i] -= size
            columns.append((of(ahead) - of(back)) / (ahead[i] - back[i]))
        return np.array(columns).T

    of_step = slopes(step)
    return Linearised(of_step[:, :n], of_step[:, n:], slopes(output)[:, :n], output(base))


def _gains(plant: Linearised, cost: HorizonCost, preview_steps: int) -> tuple[Array, Array]:
    """K (m, n + m) on the state and the control before, F (N, m, l) on r_1 .. r_N."""
    from scipy.linalg import solve_discrete_are

    n, m = plant.B.shape
    A = np.block([[plant.A, plant.B], [np.zeros((m, n)), np.eye(m)]])
    B = np.vstack([plant.B, np.eye(m)])
    C = np.hstack([plant.C, np.zeros((len(plant.C), m))])
    Q = C.T @ C + np.diag(np.append(np.zeros(n), cost.control))
    R = np.diag(cost.change)
    P = solve_discrete_are(A, B, Q, R)
    to_change = np.linalg.solve(R + B.T @ P @ B, B.T)
    feedback = to_change @ P @ A
    closed = (A - B @ feedback).T
    of_steps, pull = [], C.T
    for _ in range(preview_steps - 1):
        of_steps.append(to_change @ pull)
        pull = closed @ pull
    of_steps.append(to_change @ np.linalg.solve(np.eye(n + m) - closed, pull))
    return feedback, np.array(of_steps)


@lru_cache(maxsize=8)
def _designed(
    settings: LqrSettings, plant: Plant, outputs: tuple[str, ...]
) -> tuple[Callable[[Array], Array], tuple[Array, ...]]:
    """How a state is reduced, and what a `Tracking` begins with."""
    cost = cost_of(settings, plant)
    about = plant.reduced(cost.nominal)
    model = linearised(plant, about, cost.nominal, outputs)
    K, F = _gains(model, cost, settings.horizon_steps)
    return about.reduce, (K, F, model.C, about.state, cost.nominal, model.outputs)


class Tracking(NamedTuple):
    """K, F and C, the equilibrium z (n,), u (m,) and its outputs (l,), limits (3, m), u_k-1 (m,).

    xi (n + m,), wanted (m,): scratch
    """

    K: Array
    F: Array
    C: Array
    state: Array
    nominal: Array
    outputs: Array
    limits: Array
    previous: Array
    xi: Array
    wanted: Array


class LinearQuadraticController(LimitedController):
    """The regulator about the plant's equilibrium under the control at rest (`Plant.reduced`)."""

    telemetry_names: tuple[str, ...] = ("error", "beyond_limits")

    def __init__(
        self, settings: LqrSettings, plant: Plant, outputs: tuple[str, ...], dt_s: float, seed: int = 0
    ) -> None:
        self._reduce, found = _designed(settings, plant, outputs)
        self.preview_steps = settings.preview_steps(dt_s)
        super().__init__(plant)
        m, states = found[0].shape
        numbers = Tracking._make([*found, self._limits, self._previous, np.empty(states), np.empty(m)])
        self._out = np.empty(len(self.telemetry_names) + 1)
        example = numbers.state, np.empty((1, len(outputs))), self._out
        self._track = by_address([(track, numbers)], *example)

    def decide(self, state: Array, preview: Array) -> Decision:
        """u_k = u_k-1 - K xi + F r, then the limits."""
        out = self._out
        self._track(self._reduce(state), preview, out)
        return Decision(self._previous.copy(), out[:-1].copy(), _STATUS[int(out[-1])])


@unfused
def track(z: Array, preview: Array, numbers: Tracking, out: Array) -> None:
    """Move the control on; write the distance of the outputs, how far it is beyond limits, and the status."""
    K, F, previous = numbers.K, numbers.F, numbers.previous
    n, m, l = z.shape[0], previous.shape[0], numbers.outputs.shape[0]
    xi, wanted = numbers.xi, numbers.wanted
    for a in range(n):
        xi[a] = z[a] - numbers.state[a]
    for c in range(m):
        xi[n + c] = previous[c] - numbers.nominal[c]
    error, beyond = 0.0, 0.0
    for k in range(l):
        distance = preview[0, k] - numbers.outputs[k]
        for a in range(n):
            distance -= numbers.C[k, a] * xi[a]
        error = np.hypot(error, distance)
    for c in range(m):
        wanted[c] = previous[c]
        for a in range(n + m):
            wanted[c] -= K[c, a] * xi[a]
        for j in range(F.shape[0]):
            for k in range(l):
                wanted[c] += F[j, c, k] * (preview[j + 1, k] - numbers.outputs[k])
        if not abs(wanted[c]) < np.inf:
            out[0], out[1], out[2] = 0.0, 0.0, _KEPT_PREVIOUS
            return
    limit(wanted, numbers.limits, previous)
    for c in range(m):
        beyond = max(beyond, abs(wanted[c] - previous[c]))
    out[0], out[1], out[2] = error, beyond, _SOLVED if beyond == 0.0 else _SATURATED
