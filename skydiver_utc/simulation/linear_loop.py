"""The package's UTC on a linear plant, to hold the theory against."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.control.limits import ControlLimits
from skydiver_utc.control.utc import UtcLaw
from skydiver_utc.theory.linear_plant import LinearPlant, to_the_horizon

Array = NDArray[np.float64]

_W0 = 0.25


def fly_linear(
    plant: LinearPlant,
    horizon_steps: int,
    Pu: Array,
    Qu: Array,
    P_err: Array,
    start: Array,
    steps: int,
    added: Callable[[Array], Array] | None = None,
) -> Array:
    """z = (x, u_before) of a regulated run, (steps+1, n+m), from start (n+m,), no bounds.

    `added` is the nonlinearity f(x) of x+ = A x + B u + f(x); the controller's model does not have it.
    """
    n, m = plant.B.shape
    F, H = to_the_horizon(plant, horizon_steps)

    def predict(
        state: Array, applied: Array, points: Array, preview: Array, outputs: Array, saved: Array
    ) -> None:
        outputs[:] = F @ state + points @ H.T
        saved[:] = points

    law = UtcLaw(predict, _unlimited(m), P_err, _W0, covariance_floor=0.0)
    law.reset(start[n:], Pu)
    run = np.empty((steps + 1, n + m))
    run[0] = start
    wanted = np.zeros(len(plant.C))
    for k in range(steps):
        x = run[k, :n]
        control = law.step(x, wanted, wanted, Qu).control
        following = plant.A @ x + plant.B @ control
        run[k + 1, :n] = following if added is None else following + added(x)
        run[k + 1, n:] = control
    return run


def updated_control(B: Array, Pu: Array, P_err: Array, W0: float, before: Array, wanted: Array) -> Array:
    """The control (m,) that one step of UTC moves `before` to, on y = B u without bounds, y wanted (l,)."""

    def predict(
        _state: Array, _applied: Array, points: Array, _preview: Array, outputs: Array, saved: Array
    ) -> None:
        outputs[:] = points @ B.T
        saved[:] = points

    law = UtcLaw(predict, _unlimited(len(before)), P_err, W0)
    law.reset(before, Pu)
    return law.step(np.zeros(1), np.zeros(1), wanted, np.zeros_like(Pu)).control


def _unlimited(m: int) -> ControlLimits:
    far = np.full(m, np.inf)
    return ControlLimits(-far, far, far)


def measured_decay(distances: Array) -> float:
    """Factor per step of a decaying series (steps,): the slope of its logarithm, in the least squares."""
    alive = distances > 0.0
    slope: float = np.polyfit(np.flatnonzero(alive), np.log(distances[alive]), 1)[0]
    return float(np.exp(slope))
