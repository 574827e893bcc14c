"""A user's functions, tried once: every error is one sentence that names the function."""

import inspect
from collections.abc import Callable
from typing import Any

import numpy as np
from numba.core.errors import NumbaError
from numpy.typing import NDArray

from skydiver_utc.control.arguments import shown

Array = NDArray[np.float64]

# plant(state (n,), control (m,), dt) -> state (n,) a step later; or plant(state, control, dt, out) that writes it.
Plant = Callable[..., Any]
# output(state (n,)) -> outputs (l,), or one number.
Output = Callable[[Array], Any]
# control_dynamics(point (m,), control (m,) before, state (n,), preview (N+1, l), j) -> control (m,) on step j.
ControlDynamics = Callable[[Array, Array, Array, Array, int], Any]

_PLANT = "plant must be a function (state, control, dt) -> state, or (state, control, dt, out)"
_DYNAMICS = "control_dynamics must be a function (point, control, state, preview, j) -> control, or None"
# What a function raises that has left where it is defined: LinAlgError is a ValueError.
LEFT_ITS_DOMAIN = (ArithmeticError, ValueError, IndexError)
# What else one raises that was not written for its arguments.
MISTAKES = (AssertionError, AttributeError, LookupError, NameError, RuntimeError, TypeError, NumbaError)


def outputs(plant: Any, output: Any, state: Array, control: Array, dt: float) -> int:
    """How many outputs the output map has, after one step of the plant from an example."""
    written = np.full_like(state, np.nan)
    following = _tried("plant", control, in_one_form(plant), state.copy(), control.copy(), dt, written)
    if following.shape != state.shape:
        raise ValueError(f"plant returns shape {following.shape} for a state of shape {state.shape}.")
    if not np.isfinite(following).all():
        raise ValueError(
            f"plant returns {shown(following)} for the state and control given: it must be finite."
        )
    if not callable(output):
        raise ValueError("output must be a function of the state, or None for the whole state.")
    values = _tried("output", control, output, following)
    if values.ndim > 1 or values.size == 0:
        raise ValueError(f"output returns shape {values.shape}; it must be a vector or one number.")
    if not np.isfinite(values).all():
        raise ValueError(f"output returns {shown(values)} one step from the state given: it must be finite.")
    return values.size


def try_dynamics(dynamics: Any, control: Array, state: Array, preview: Array) -> None:
    """The control dynamics return a control on an example."""
    if not callable(dynamics):
        raise ValueError(f"{_DYNAMICS}, not {dynamics!r}.")
    given = control.copy(), control.copy(), state.copy(), preview, 0
    found = _tried("control_dynamics", control, dynamics, *given)
    if found.shape != control.shape:
        raise ValueError(
            f"control_dynamics returns shape {found.shape} for a control of shape {control.shape}."
        )


def writes_into(plant: Any) -> bool:
    """Whether a plain or jitted plant writes into a fourth argument: one that has no default."""
    if not callable(plant):
        raise ValueError(f"{_PLANT}, not {plant!r}.")
    try:
        parameters = inspect.signature(getattr(plant, "py_func", plant)).parameters.values()
    except ValueError as error:
        raise ValueError(f"{_PLANT}, not {plant!r}, which does not tell its parameters.") from error
    positional = [p for p in parameters if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)]
    needed = sum(p.default is p.empty for p in positional)
    for p in parameters:
        if p.kind is p.KEYWORD_ONLY and p.default is p.empty:
            raise ValueError(f"{_PLANT}; its parameter {p.name} needs a default.")
    more = any(p.kind is p.VAR_POSITIONAL for p in parameters)
    if needed > 4 or (len(positional) < 3 and not more):
        raise ValueError(f"{_PLANT}; this one has {needed} parameters without a default.")
    return needed == 4


def in_one_form(plant: Any) -> Callable[[Array, Array, float, Array], Any]:
    """The plant as (state, control, dt, out) -> state one step later, whichever of its two forms it has."""
    writes = writes_into(plant)

    def following(state: Array, control: Array, dt: float, out: Array) -> Any:
        if not writes:
            return plant(state, control, dt)
        plant(state, control, dt, out)
        return out

    return following


def as_numbers(returned: Any) -> Array:
    """What a function returned, as an array of numbers; raises on None and on complex numbers."""
    if returned is None:
        raise TypeError("it returns None")
    found = np.asarray(returned)
    if found.dtype.kind == "c":
        raise ArithmeticError("it returns complex numbers")
    return np.asarray(found, dtype=float)


def one_line(error: BaseException) -> str:
    """What an error says, numba's many lines reduced to the one that tells what was not possible."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    # Numba's first lines say only in which of its passes it happened.
    lines = [line for line in lines if not line.startswith("Failed in nopython mode")]
    if not lines:
        return type(error).__name__
    telling = [line for line in lines if line.startswith(("No implementation", "Invalid use", "Unknown"))]
    return (telling or lines)[0].rstrip(".:")


def _tried(name: str, control: Array, function: Any, *example: Any) -> Array:
    """What the function returns on an example, as an array of numbers."""
    try:
        returned = function(*example)
        found = None if returned is None else as_numbers(returned)
    except (*LEFT_ITS_DOMAIN, *MISTAKES) as error:
        hint = ""
        if name != "output" and not isinstance(error, (ArithmeticError, LookupError)):
            hint = f"; control is an array of shape {control.shape}: its first entry is u[0], not u"
        raise ValueError(
            f"{name} fails on the example given ({type(error).__name__}: {one_line(error)}){hint}."
        ) from error
    if found is None:
        raise ValueError(f"{name} returns None on the example given: write its return.")
    return found
