"""A user's functions inside the horizon: one rule for what they raise, and one shape for what they return."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.control.plant_functions import (
    LEFT_ITS_DOMAIN,
    MISTAKES,
    ControlDynamics,
    Output,
    Plant,
    as_numbers,
    in_one_form,
    one_line,
)

Array = NDArray[np.float64]


class GuardedFunctions:
    """Plant, output map and control dynamics as the roll-out calls them from Python, jitted or not.

    An ArithmeticError, ValueError (LinAlgError is one) or IndexError of any of them means that the sigma point has
    diverged: what it stands for is NaN from there on, and `cause` tells of the first such error, "" without one.
    Every other error of Python's own becomes a ValueError that names function and step of the horizon, and so does
    what is returned in another shape: states (n,), outputs (l,), controls (m,); one number may stand for (1,).
    """

    def __init__(
        self,
        plant: Plant,
        output: Output,
        control_dynamics: ControlDynamics,
        states: int,
        outputs: int,
        controls: int,
    ) -> None:
        self._plant, self._output, self._dynamics = in_one_form(plant), output, control_dynamics
        self._states, self._outputs, self._controls = (states,), (outputs,), (controls,)
        self._step = 0
        self.cause = ""

    def dynamics(self, point: Array, control: Array, state: Array, preview: Array, j: int) -> Array:
        """The control (m,) on step j, the first that is asked for in each step."""
        self._step = j + 1
        given = point, control, state, preview, j
        return self._returned("control_dynamics", self._controls, self._dynamics, *given)

    def plant(self, state: Array, control: Array, dt: float, out: Array) -> None:
        """Write the next state (n,)."""
        out[:] = np.nan
        # Control dynamics that diverged: the plant need not know what to do with NaN.
        if np.isfinite(control).all():
            out[:] = self._returned("plant", self._states, self._plant, state, control, dt, out)

    def output(self, state: Array) -> Array:
        """The outputs (l,)."""
        return self._returned("output", self._outputs, self._output, state)

    def _returned(self, name: str, shape: tuple[int], function: Any, *given: Any) -> Array:
        try:
            found = as_numbers(function(*given))
        except LEFT_ITS_DOMAIN as error:
            told = f"{name} raises {type(error).__name__} on step {self._step}: {one_line(error)}"
            self.cause = self.cause or told
            return np.full(shape, np.nan)
        except MISTAKES as error:
            raise ValueError(
                f"{name} fails on step {self._step} of the horizon ({type(error).__name__}: {one_line(error)})."
            ) from error
        if found.shape != shape and not found.size == math.prod(shape) == 1:
            raise ValueError(
                f"{name} returns shape {found.shape} on step {self._step} of the horizon instead of {shape}."
            )
        return found.reshape(shape)
