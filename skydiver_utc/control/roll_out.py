"""The predict function of a plant that is given as functions, jitted or plain Python.

One text serves both: `_roll_out` is compiled when the plant is a numba function and interpreted when it is not.
"""

from functools import lru_cache
from typing import Any

import numba
import numpy as np
from numba.core.errors import NumbaError
from numpy.typing import NDArray

from skydiver_utc.control.limits import ControlLimits
from skydiver_utc.control.plant_functions import ControlDynamics, Output, Plant, one_line, writes_into

Array = NDArray[np.float64]


class RollOut:
    """Drives each sigma point to the horizon; see `skydiver_utc.control.utc.Predict`.

    `steps` holds the steps at which outputs are taken, in rising order; all of their outputs stand in one row, and
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
        drawn: NDArray[np.int64],
    ) -> None:
        self.jitted = is_jitted(plant)
        dynamics = _held if control_dynamics is None else control_dynamics
        self._roll_out = (
            _compiled(plant, output, dynamics) if self.jitted else _plain(plant, output, dynamics)
        )
        self._steps = np.array(steps, dtype=np.int64)
        self._drawn = drawn
        self._own_dynamics = control_dynamics is not None
        self._dt = dt
        self._limits = limits
        m = len(limits.minimum)
        self._work = (np.empty(states), np.empty(states), np.empty(m))

    def check(self, *example: Any) -> None:
        """Compile on an example, so that numba's objection to a function becomes one sentence."""
        try:
            self(*example)
        except NumbaError as error:
            raise ValueError(
                f"plant is jitted, but it or output or control_dynamics does not compile: {one_line(error)}."
            ) from error

    def __call__(
        self, state: Array, applied: Array, points: Array, preview: Array, outputs: Array, saved: Array
    ) -> None:
        """Write outputs (2m+1, l), NaN where a point diverged, and the controls (2m+1, m) that stand for points."""
        try:
            with np.errstate(all="ignore"):
                self._roll_out(
                    state, applied, points, preview, self._steps, self._drawn, self._dt, self._own_dynamics,
                    self._limits.minimum, self._limits.maximum, self._limits.slew, outputs, saved, *self._work,
                )  # fmt: skip
        except ArithmeticError as error:
            raise ValueError(
                f"plant is jitted, and it or output or control_dynamics raises {type(error).__name__}"
                f' ({one_line(error)}); jit it with @njit(error_model="numpy"), so that it goes on with infinity.'
            ) from error


def is_jitted(function: object) -> bool:
    """Whether numba can call the function from compiled code."""
    return isinstance(function, numba.core.dispatcher.Dispatcher)


def _plain(plant: Any, output: Any, dynamics: Any) -> Any:
    return _roll_out(_guarded_plant(_writing(plant)), _or_nan(output), _or_nan(dynamics, of_control=True))


@lru_cache(maxsize=64)
def _compiled(plant: Any, output: Any, dynamics: Any) -> Any:
    """The same functions again need no new compilation."""
    functions = [_jit(function) for function in (_writing(plant), output, dynamics)]
    return numba.njit(error_model="numpy")(_roll_out(*functions))


def _jit(function: Any) -> Any:
    """The function compiled, because the plant is: a plain output map beside a jitted plant is welcome, too."""
    return function if is_jitted(function) else numba.njit(error_model="numpy")(function)


def _writing(plant: Any) -> Any:
    """The plant in the form that writes the next state into its fourth argument."""
    if writes_into(plant):
        return plant

    def write(state: Array, control: Array, dt: float, out: Array) -> None:
        out[:] = plant(state, control, dt)

    return write


def _guarded_plant(write: Any) -> Any:
    """Plain Python raises where compiled code goes on with infinity: both mean that the point diverged."""

    def guarded(state: Array, control: Array, dt: float, out: Array) -> None:
        out[:] = np.nan
        # Control dynamics that diverged: the plant need not know what to do with NaN.
        if not np.isfinite(control).all():
            return
        try:
            write(state, control, dt, out)
        except (ArithmeticError, ValueError) as error:
            _only_arithmetic(error)
            out[:] = np.nan

    return guarded


def _or_nan(function: Any, *, of_control: bool = False) -> Any:
    """The output map or the control dynamics, NaN where the arithmetic fails."""

    def guarded(*given: Any) -> Any:
        try:
            return function(*given)
        except (ArithmeticError, ValueError) as error:
            _only_arithmetic(error)
            return np.full_like(given[0], np.nan) if of_control else np.nan

    return guarded


def _only_arithmetic(error: Exception) -> None:
    """Raise again what is no failure of the arithmetic; math.sqrt(-1.0) is one, and a matrix without inverse."""
    if isinstance(error, (ArithmeticError, np.linalg.LinAlgError)) or str(error) == "math domain error":
        return
    raise error


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
