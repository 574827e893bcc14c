"""The package's UTC on a linear plant, to hold the theory against."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.control.limits import ControlLimits
from skydiver_utc.control.utc import UtcLaw
from skydiver_utc.theory.linear_plant import LinearPlant, to_the_horizon
from skydiver_utc.theory.stability import Stability

Array = NDArray[np.float64]

_W0 = 0.25
# A free run is followed until the distance from rest has shrunk this far, within these numbers of steps.
_SHRUNK, _FEWEST_STEPS, _MOST_STEPS = 1e-8, 20, 20_000


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


def distance_flown(
    plant: LinearPlant,
    horizon_steps: int,
    Qu: Array,
    P_err: Array,
    found: Stability,
    start: Array,
    steps: int,
    added: Callable[[Array], Array] | None = None,
) -> Array:
    """Distance from rest (steps+1,) of a run of `fly_linear` whose gain is steady from the first step."""
    Pu = found.gain.covariance + found.gain.growth
    run = fly_linear(plant, horizon_steps, Pu, Qu, P_err, start, steps, added)
    distances: Array = np.linalg.norm(run @ found.across, axis=1)
    return distances


def measured_decay(
    plant: LinearPlant, horizon_steps: int, Qu: Array, P_err: Array, found: Stability
) -> float:
    """Factor per step of the distance from rest, flown in the slowest mode of a stable loop.

    The slope of its logarithm, in the least squares, over all of the run: the gain is steady and the mode alone, so
    nothing has to settle, and the longer the run, the less the swing of an oscillating mode counts.
    """
    wanted = np.log(_SHRUNK) / np.log(found.decay)
    steps = int(np.clip(wanted, _FEWEST_STEPS, _MOST_STEPS))
    distances = distance_flown(plant, horizon_steps, Qu, P_err, found, found.slowest, steps)
    alive = distances > 0.0
    slope: float = np.polyfit(np.flatnonzero(alive), np.log(distances[alive]), 1)[0]
    return float(np.exp(slope))
