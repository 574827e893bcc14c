# SPDX-License-Identifier: Apache-2.0
"""Nonlinear model predictive control of the textbook plants: CasADi and IPOPT, solved to convergence.

Multiple shooting over N steps with a control for each, written out in scalars (`expand`), started from the solution
before; not compiled. It minimises the cost of `skydiver_utc/controllers/horizon.py` with as many blocks as steps,
under the bounds and rates of the controls.
"""

from typing import Any

import casadi as ca
import numpy as np
from textbook_plants import TextbookPlant, symbolic_outputs, symbolic_step

from skydiver_utc.controllers.horizon import cost_of
from skydiver_utc.controllers.protocol import Decision, Status
from skydiver_utc.controllers.settings import GaussNewtonSettings

_OPTIONS = {
    "print_time": False,
    "expand": True,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.max_iter": 50,
}
# From the solution before, so that the barrier may start low and the point near its bounds.
_WARM = {
    "mu_init": 1e-4,
    "tol": 1e-6,
    "warm_start_init_point": "yes",
    "bound_push": 1e-6,
    "warm_start_bound_push": 1e-6,
}


def model_of(plant: TextbookPlant) -> ca.Function:
    """(state (n,), control (m,)) -> (state one step later, its outputs (l,))."""
    with _numpy_on_symbols():
        x, u = ca.SX.sym("x", len(plant.state_names)), ca.SX.sym("u", len(plant.control_names))
        numbers = plant.model.parameters
        after = symbolic_step(plant.about, ca.vertsplit(x), ca.vertsplit(u), numbers)
        outputs = symbolic_outputs(plant.about, after, numbers)
        return ca.Function("model", [x, u], [ca.vertcat(*after), ca.vertcat(*outputs)])


class PredictiveController:
    """The controller, in the package's slot; where IPOPT gives up it applies what IPOPT reached."""

    telemetry_names = ("iterations",)

    def __init__(self, settings: GaussNewtonSettings, plant: TextbookPlant) -> None:
        self.preview_steps = self._steps = settings.horizon_steps
        self._n, self._m = len(plant.state_names), len(plant.control_names)
        self._initial = plant.initial_control()
        # IPOPT's variables are shares of the controls' ranges and of the states' sizes.
        self._minimum, self._ranges = plant.minimum, plant.maximum - plant.minimum
        self._sizes = np.maximum(np.abs(plant.initial_state()), 1.0)
        self._change = np.tile(plant.rate * plant.dt_s, self._steps)
        self._solver = self._program(settings, plant)
        self.reset()

    def reset(self) -> None:
        """Start again from the initial control."""
        self.resume(self._initial)

    def resume(self, control: np.ndarray) -> None:
        """Start from this control (m,), the one applied last."""
        self._applied = np.array(control)
        self._controls = np.tile(self._applied, (self._steps, 1))
        self._states = np.empty((0, self._n))

    def decide(self, state: np.ndarray, preview: np.ndarray) -> Decision:
        """Control for a state (n,) and the reference preview (N + 1, l)."""
        N, m, n = self._steps, self._m, self._n
        if not len(self._states):
            self._states = np.tile(state, (N, 1))
        shares, unbounded = (self._controls - self._minimum) / self._ranges, np.full(N * n, np.inf)
        found = self._solver(
            x0=np.concatenate([shares.ravel(), (self._states / self._sizes).ravel()]),
            p=np.concatenate([state, self._applied, preview[1 : N + 1].ravel()]),
            lbx=np.concatenate([np.zeros(N * m), -unbounded]),
            ubx=np.concatenate([np.ones(N * m), unbounded]),
            lbg=np.concatenate([np.zeros(N * n), -self._change]),
            ubg=np.concatenate([np.zeros(N * n), self._change]),
        )
        solution, stats = np.array(found["x"]).ravel(), self._solver.stats()
        controls = self._minimum + self._ranges * solution[: N * m].reshape(N, m)
        states = self._sizes * solution[N * m :].reshape(N, n)
        self._applied = np.clip(controls[0], self._minimum, self._minimum + self._ranges)
        self._controls = np.vstack([controls[1:], controls[-1:]])
        self._states = np.vstack([states[1:], states[-1:]])
        status = Status.SOLVED if stats["success"] else Status.REPAIRED
        return Decision(self._applied.copy(), np.array([float(stats["iter_count"])]), status)

    def _program(self, settings: GaussNewtonSettings, plant: TextbookPlant) -> Any:
        N, m, n, l = self._steps, self._m, self._n, len(plant.output_names)
        cost, model = cost_of(settings, plant), model_of(plant)
        shares, scaled = ca.MX.sym("shares", m, N), ca.MX.sym("scaled", n, N)
        U = ca.repmat(ca.DM(self._minimum), 1, N) + ca.mtimes(ca.diag(ca.DM(self._ranges)), shares)
        X = ca.mtimes(ca.diag(ca.DM(self._sizes)), scaled)
        state, applied, reference = ca.MX.sym("state", n), ca.MX.sym("applied", m), ca.MX.sym("r", l, N)
        after, outputs = model.map(N)(ca.horzcat(state, X[:, :-1]), U)
        changes = U - ca.horzcat(applied, U[:, :-1])
        effort = ca.mtimes(cost.control[None], (U - ca.repmat(ca.DM(cost.nominal), 1, N)) ** 2)
        effort += ca.mtimes(cost.change[None], changes**2)
        nlp = {
            "x": ca.veccat(shares, scaled),
            "p": ca.veccat(state, applied, reference),
            "f": (ca.sumsqr(outputs - reference) + ca.sum2(effort)) / N,
            "g": ca.veccat(ca.mtimes(ca.diag(ca.DM(1.0 / self._sizes)), after - X), changes),
        }
        return ca.nlpsol("predictive", "ipopt", nlp, _OPTIONS | {f"ipopt.{k}": v for k, v in _WARM.items()})


class _numpy_on_symbols:  # noqa: N801 - a context manager
    """NumPy's functions on CasADi's symbols without its notice (CasADi 3.8 and later)."""

    def __enter__(self) -> None:
        if hasattr(ca.GlobalOptions, "setNumpyMode"):
            ca.GlobalOptions.setNumpyMode(-1)

    def __exit__(self, *_: object) -> None:
        if hasattr(ca.GlobalOptions, "setNumpyMode"):
            ca.GlobalOptions.setNumpyMode(0)
