# SPDX-License-Identifier: Apache-2.0
"""The package's UTC on a linear plant, to hold the theory against."""

from collections.abc import Callable

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.utc.settings import UtcSettings
from skydiver_utc.controllers.utc.unscented_transform_controller import UnscentedTransformController
from skydiver_utc.plants.linear import LinearModel, linear_outputs, linear_step
from skydiver_utc.plants.protocol import Model, Plant
from skydiver_utc.theory.stability import Stability

_W0 = 0.25
# A free run is followed until the distance from rest has shrunk this far, within these numbers of steps.
_SHRUNK, _FEWEST_STEPS, _MOST_STEPS = 1e-8, 20, 20_000


def fly_linear(
    plant: LinearModel,
    horizon_steps: int,
    Qu: Array,
    P_err: Array,
    found: Stability,
    start: Array,
    steps: int,
    added: Callable[[Array], Array] | None = None,
) -> Array:
    """z = (x, u_before) of a regulated run, (steps+1, n+m), from start (n+m,), no bounds, with the steady gain.

    `added` is the nonlinearity f(x) of x+ = A x + B u + f(x); the controller's model does not have it. The distance
    from rest of a row z is the length of `z @ found.across`.
    """
    n, m = plant.B.shape
    Pu = found.gain.covariance + found.gain.growth
    settings = UtcSettings(
        horizon_steps=horizon_steps,
        P_err=P_err.tolist(),
        W0=_W0,
        Pu=Pu.tolist(),
        Qu=Qu.tolist(),
        covariance_floor=0.0,
    )
    controller = UnscentedTransformController(settings, _Unlimited(plant))
    controller.reset(start[n:], Pu)
    run = np.empty((steps + 1, n + m))
    run[0] = start
    wanted = np.zeros(len(plant.C))
    for k in range(steps):
        x = run[k, :n]
        control = controller.step(x, wanted).control
        following = plant.A @ x + plant.B @ control
        run[k + 1, :n] = following if added is None else following + added(x)
        run[k + 1, n:] = control
    return run


def updated_control(B: Array, Pu: Array, P_err: Array, W0: float, before: Array, wanted: Array) -> Array:
    """The control (m,) that one step of UTC moves `before` to, on y = B u without bounds, y wanted (l,)."""
    l = len(B)
    settings = UtcSettings(horizon_steps=1, P_err=P_err.tolist(), W0=W0, Pu=Pu.tolist())
    model = LinearModel(np.zeros((l, l)), np.ascontiguousarray(B), np.eye(l))
    controller = UnscentedTransformController(settings, _Unlimited(model))
    controller.reset(before, Pu)
    return controller.step(np.zeros(l), wanted).control


class _Unlimited(Plant):
    """A linear plant without limits, from rest."""

    def __init__(self, matrices: LinearModel) -> None:
        n, m = matrices.B.shape
        self.state_names, self.control_names = _names("x", n), _names("u", m)
        self.output_names = _names("y", len(matrices.C))
        self.maximum = self.rate = np.full(m, np.inf)
        self.minimum, self.dt_s = -self.maximum, 1.0
        self.model = Model(linear_step, linear_outputs, LinearModel(*map(np.ascontiguousarray, matrices)), n)

    def initial_state(self) -> Array:
        """At rest."""
        return np.zeros(len(self.state_names))


def _names(letter: str, count: int) -> tuple[str, ...]:
    return tuple(f"{letter}{i}" for i in range(count))


def measured_decay(
    plant: LinearModel, horizon_steps: int, Qu: Array, P_err: Array, found: Stability
) -> float:
    """Factor per step of the distance from rest, flown in the slowest mode of a stable loop.

    The slope of its logarithm, in the least squares, over all of the run: the gain is steady and the mode alone, so
    nothing has to settle, and the longer the run, the less the swing of an oscillating mode counts.
    """
    wanted = np.log(_SHRUNK) / np.log(found.decay)
    steps = int(np.clip(wanted, _FEWEST_STEPS, _MOST_STEPS))
    run = fly_linear(plant, horizon_steps, Qu, P_err, found, found.slowest, steps)
    distances = np.linalg.norm(run @ found.across, axis=1)
    alive = distances > 0.0
    slope: float = np.polyfit(np.flatnonzero(alive), np.log(distances[alive]), 1)[0]
    return float(np.exp(slope))
