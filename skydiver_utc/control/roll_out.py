"""The predict function of a plant that is given as functions, jitted or plain Python.

One text serves both: `_roll_out` is compiled when the plant is a numba function, and interpreted when it is not and
where compiled code raised an error.
"""

from functools import lru_cache
from typing import Any

import numba
import numpy as np
from numba.core.errors import NumbaError
from numpy.typing import NDArray

from skydiver_utc.control.guarded_functions import GuardedFunctions
from skydiver_utc.control.limits import ControlLimits
from skydiver_utc.control.plant_functions import (
    LEFT_ITS_DOMAIN,
    MISTAKES,
    ControlDynamics,
    Output,
    Plant,
    one_line,
    writes_into,
)

Array = NDArray[np.float64]


class RollOut:
    """Drives each sigma point to the horizon; see `skydiver_utc.control.utc.Predict`.

    `steps` holds the steps at which outputs (l,) are taken, in rising order; all of them stand in one row, and
    after them the controls whose indices are in `drawn`, which are drawn to rest.
    """

    def __init__(
        self,
        plant: Plant,
        output: Output,
        control_dynamics: ControlDynamics | None,
        steps: tuple[int, ...],
        dt: float,
        limits: ControlLimits,
        states: int,
        outputs: int,
        drawn: NDArray[np.int64],
    ) -> None:
        self.jitted = is_jitted(plant)
        dynamics = _held if control_dynamics is None else control_dynamics
        m = len(limits.minimum)
        guarded = self._guarded = GuardedFunctions(plant, output, dynamics, states, outputs, m)
        self._plain = _roll_out(guarded.plant, guarded.output, guarded.dynamics)
        self._roll_out = _compiled(plant, output, dynamics) if self.jitted else self._plain
        self._constant = (
            np.array(steps, dtype=np.int64), drawn, dt, control_dynamics is not None,
            limits.minimum, limits.maximum, limits.slew,
        )  # fmt: skip
        self._work = (np.empty(states), np.empty(states), np.empty(m))

    @property
    def cause(self) -> str:
        """The first error by which a point of the last call diverged, in words; "" without one."""
        return self._guarded.cause

    def check(self, *example: Any) -> None:
        """Compile on an example, so that numba's objection to a function becomes one sentence."""
        if self.jitted:
            given = self._given(*example)
            try:
                self._roll_out.compile(tuple(map(numba.typeof, given)))
            except NumbaError as error:
                raise ValueError(
                    "plant is jitted, but it or output or control_dynamics does not compile:"
                    f" {one_line(error)}."
                ) from error
        self(*example)

    def __call__(
        self, state: Array, applied: Array, points: Array, preview: Array, outputs: Array, saved: Array
    ) -> None:
        """Write outputs (2m+1, l), NaN where a point diverged, and the controls (2m+1, m) that stand for points."""
        given = self._given(state, applied, points, preview, outputs, saved)
        self._guarded.cause = ""
        with np.errstate(all="ignore"):
            try:
                self._roll_out(*given)
            except (*LEFT_ITS_DOMAIN, *MISTAKES):
                if not self.jitted:
                    raise
                # Compiled code cannot go on, nor tell point, function and step: the same again from Python.
                self._plain(*given)

    def _given(
        self, state: Array, applied: Array, points: Array, preview: Array, outputs: Array, saved: Array
    ) -> tuple[Any, ...]:
        return (state, applied, points, preview, *self._constant, outputs, saved, *self._work)


def is_jitted(function: object) -> bool:
    """Whether numba can call the function from compiled code."""
    return isinstance(function, numba.core.dispatcher.Dispatcher)


@lru_cache(maxsize=64)
def _compiled(plant: Any, output: Any, dynamics: Any) -> Any:
    """The same functions again need no new compilation."""
    functions = [_jit(function) for function in (_writing(plant), output, dynamics)]
    return numba.njit(error_model="numpy")(_roll_out(*functions))


def _jit(function: Any) -> Any:
    """The function compiled, because the plant is: a plain output map beside a jitted plant is welcome, too."""
    return function if is_jitted(function) else numba.njit(error_model="numpy")(function)


def _writing(plant: Any) -> Any:
    """The jitted plant in the form that writes the next state into its fourth argument."""
    if writes_into(plant):
        return plant

    def write(state: Array, control: Array, dt: float, out: Array) -> None:
        following = plant(state, control, dt)
        if len(following) != len(out):
            raise ValueError
        out[:] = following

    return write


def _held(point: Array, control: Array, state: Array, preview: Array, j: int) -> Array:
    return point


def _roll_out(plant: Any, output: Any, dynamics: Any) -> Any:
    """The loop over sigma points and steps, around three functions that it calls."""

    def roll_out(
        state: Array,
        applied: Array,
        points: Array,
        preview: Array,
        steps: NDArray[np.int64],
        drawn: NDArray[np.int64],
        dt: float,
        own_dynamics: bool,
        minimum: Array,
        maximum: Array,
        slew: Array,
        outputs: Array,
        saved: Array,
        x: Array,
        following: Array,
        control: Array,
    ) -> None:
        of_plant = outputs.shape[1] - drawn.shape[0]
        size = of_plant // steps.shape[0]
        for i in range(points.shape[0]):
            x[:] = state
            control[:] = applied
            saved[i, :] = points[i]
            outputs[i, :] = np.nan
            taken = 0
            for j in range(steps[-1]):
                wanted = dynamics(points[i], control, x, preview, j)
                for a in range(control.shape[0]):
                    asked, before = wanted[a], control[a]
                    for low, high in ((minimum[a], maximum[a]), (before - slew[a], before + slew[a])):
                        if asked < low:
                            asked = low
                        if asked > high:
                            asked = high
                    control[a] = asked
                if own_dynamics and j == 0:
                    saved[i, :] = control
                plant(x, control, dt, following)
                x[:] = following
                if not np.isfinite(x).all():
                    break
                if j + 1 == steps[taken]:
                    outputs[i, taken * size : (taken + 1) * size] = output(x)
                    taken += 1
            for k in range(drawn.shape[0]):
                outputs[i, of_plant + k] = saved[i, drawn[k]]

    return roll_out
