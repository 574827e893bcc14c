# SPDX-License-Identifier: Apache-2.0
"""A plant that is given as functions of Python, jitted by numba or not."""

import inspect
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from skydiver_utc.arrays import Array
from skydiver_utc.jit import bound, interpreted, is_jitted, keep
from skydiver_utc.plants.protocol import LEFT_ITS_DOMAIN, MISTAKES, Model, Plant, one_line

_FORM = "plant must be a function (state, control, dt) -> state, or (state, control, dt, out)"


def function(*_: Any) -> Any:
    """The function that the templates below call: each plant puts its own here."""


def step(state: Array, control: Array, parameters: Any, out: Array) -> None:
    """A plant that returns the following state."""
    following = np.asarray(function(state, control, parameters[0]))
    if following.size != out.size:
        raise TypeError("it returns another number of states")
    for i in range(out.shape[0]):
        out[i] = following[i]


def writing_step(state: Array, control: Array, parameters: Any, out: Array) -> None:
    """A plant that writes the following state into an array."""
    following = np.empty_like(out)
    function(state, control, parameters[0], following)
    for i in range(out.shape[0]):
        out[i] = following[i]


def output(state: Array, parameters: Any, out: Array) -> None:
    """An output map that returns a vector."""
    values = np.asarray(function(state))
    if values.size != out.size:
        raise TypeError("it returns another number of outputs")
    for i in range(out.shape[0]):
        out[i] = values[i]


def single_output(state: Array, parameters: Any, out: Array) -> None:
    """An output map that returns one number."""
    out[0] = function(state)


def whole_state(state: Array) -> Array:
    """The output map where there is none."""
    return state


class FunctionPlant(Plant):
    """A plant from plant(state (n,), control (m,), dt) -> state one step later, or (state, control, dt, out).

    plant: plain Python, or jitted by numba; the prediction of a controller is then compiled and kept on disk
    output: output(state) -> outputs (L,), or one number; None: the whole state
    state, control: the state at step 0 and the control before it; the functions are tried on them
    dt: length of a step in the plant's unit of time
    minimum, maximum, rate: bounds of each control and of its change per unit of time, one number for all or (m,)
    names: of states, controls and outputs; without, x0.., u0.., y0..
    A function that cannot be used is a ValueError that names it.
    """

    def __init__(
        self,
        plant: Callable[..., Any],
        output: Callable[[Array], Any] | None = None,
        *,
        state: ArrayLike,
        control: ArrayLike,
        dt: float,
        minimum: ArrayLike = -np.inf,
        maximum: ArrayLike = np.inf,
        rate: ArrayLike = np.inf,
        state_names: Sequence[str] = (),
        control_names: Sequence[str] = (),
        output_names: Sequence[str] = (),
    ) -> None:
        self._functions = plant, output
        settings = {"state": state, "control": control, "minimum": minimum, "maximum": maximum, "rate": rate}
        names = {"state_names": state_names, "control_names": control_names, "output_names": output_names}
        self._given: dict[str, Any] = {**settings, **names}
        self._state, self._control = _vector("state", state), _vector("control", control)
        n, m = len(self._state), len(self._control)
        self.dt_s = _step_length(dt)
        (self.minimum, self.maximum), self.rate = bounds(minimum, maximum, m), rates(rate, m)
        if not ((self.minimum <= self._control) & (self._control <= self.maximum)).all():
            raise ValueError(f"control {self._control.tolist()} is outside its bounds.")
        output = whole_state if output is None else output
        keep(plant)
        keep(output)
        writes = writes_its_result(plant, 4, _FORM)
        if not callable(output):
            raise ValueError("output must be a function of the state, or None for the whole state.")
        example = (np.full(n, np.nan),) if writes else ()
        following = tried("plant", plant, self._state.copy(), self._control.copy(), self.dt_s, *example)
        following = example[0] if example else following
        if following.shape != (n,):
            raise ValueError(f"plant returns shape {following.shape} for a state of shape ({n},).")
        if not np.isfinite(following).all():
            raise ValueError(
                f"plant returns {following.tolist()} for the state and control given: it must be finite."
            )
        values = tried("output", output, following)
        if values.ndim > 1 or values.size == 0:
            raise ValueError(f"output returns shape {values.shape}; it must be a vector or one number.")
        if not np.isfinite(values).all():
            raise ValueError(
                f"output returns {values.tolist()} one step from the state given: it must be finite."
            )
        self.state_names = tuple(state_names) or tuple(f"x{i}" for i in range(n))
        self.control_names = tuple(control_names) or tuple(f"u{i}" for i in range(m))
        self.output_names = tuple(output_names) or tuple(f"y{i}" for i in range(values.size))
        self.model = Model(
            in_form(writing_step if writes else step, plant, plant, "plant"),
            in_form(globals()["output"] if values.ndim else single_output, output, plant, "output"),
            (self.dt_s,),
            n,
        )

    def model_of_step(self, dt_s: float) -> Model:
        return self.model._replace(parameters=(_step_length(dt_s),))

    def __reduce__(self) -> Any:
        """Of a plant that goes to another process: the functions given, which are compiled there."""
        return partial(FunctionPlant, dt=self.dt_s, **self._given), self._functions

    def initial_state(self) -> Array:
        return self._state.copy()

    def initial_control(self) -> Array:
        return self._control.copy()


def _step_length(dt: float) -> float:
    if not (isinstance(dt, Real) and np.isfinite(dt) and dt > 0.0):
        raise ValueError(f"dt is {dt!r}; it must be a number above zero.")
    return float(dt)


def in_form(template: Any, given: Any, plant: Any, name: str) -> Any:
    """A function of the user's in the form of a template; jitted if the plant's function is."""
    if not is_jitted(plant):
        made = interpreted(template, function=given)
        made.__name__ = name
        return made
    import numba

    jitted = given if is_jitted(given) else numba.njit(error_model="numpy")(given)
    return bound(template, name, jitted, function=jitted)


def tried(name: str, function: Any, *example: Any) -> Array:
    """The value of a function on an example, as an array of numbers; of a plant that writes its result it is 0."""
    writes = name == "plant" and len(example) == 4
    try:
        returned = function(*example)
        if returned is None and not writes:
            raise TypeError("it returns None")
        found = np.asarray(0.0 if returned is None else returned)
        if found.dtype.kind == "c":
            raise ArithmeticError("it returns complex numbers")
        return np.asarray(found, dtype=float)
    except (*LEFT_ITS_DOMAIN, *MISTAKES) as error:
        hint = f"; control is an array of shape {example[1].shape}" if name == "plant" else ""
        raise ValueError(
            f"{name} fails on the example given ({type(error).__name__}: {one_line(error)}){hint}."
        ) from error


def writes_its_result(given: Any, count: int, form: str) -> bool:
    """Whether a plain or jitted function writes into its last parameter of `count`: one that has no default.

    One of `count` - 1 parameters returns its result. ValueError, which begins with `form`, for any other.
    """
    try:
        signature = inspect.signature(getattr(given, "py_func", given))
    except (TypeError, ValueError) as error:  # no function, or one whose parameters are not known
        raise ValueError(f"{form}, not {given!r}.") from error
    for arguments in (count - 1, count):
        with suppress(TypeError):
            signature.bind(*range(arguments))
            return arguments == count
    raise ValueError(f"{form}; the parameters of this one are {signature}.")


def numbers(name: str, value: ArrayLike) -> Array:
    """A new array of what was given under this name. Raises ValueError where that is no numbers."""
    try:
        found = np.asarray(value)
    except ValueError:  # rows of different lengths
        found = np.empty(0, dtype=object)
    if found.dtype.kind not in "biuf":
        raise ValueError(f"{name} must be numbers, not {value!r}.")
    return found.astype(float)


def _vector(name: str, value: ArrayLike) -> Array:
    array = np.atleast_1d(numbers(name, value))
    if array.ndim != 1 or array.size == 0 or not np.isfinite(array).all():
        raise ValueError(f"{name} must be a vector of finite numbers, not {value!r}.")
    return array


def bounds(minimum: ArrayLike, maximum: ArrayLike, m: int) -> Array:
    """Bounds (2, m) of the controls. Raises ValueError."""
    low, high = _per_control("minimum", minimum, m), _per_control("maximum", maximum, m)
    if not (low <= high).all():
        raise ValueError(f"minimum {low.tolist()} is above maximum {high.tolist()}.")
    return np.array([low, high])


def rates(given: ArrayLike, m: int) -> Array:
    """Largest changes (m,) of the controls per unit of time. Raises ValueError."""
    found = _per_control("rate", given, m)
    if not (found > 0.0).all():
        raise ValueError("rate must be above zero for every control; leave a limit out with inf.")
    return found


def _per_control(name: str, value: ArrayLike, m: int) -> Array:
    """One number for each control (m,). Raises ValueError."""
    array = numbers(name, value)
    if array.shape not in ((), (m,)) or np.isnan(array).any():
        raise ValueError(f"{name} must be one number or {m} numbers, not {value!r}.")
    return np.broadcast_to(array, (m,)).copy()
