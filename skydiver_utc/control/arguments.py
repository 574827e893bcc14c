"""What a user hands to the controller, checked once: every error is one sentence that names the argument."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def numbers(name: str, value: Any) -> Array:
    """The value as an array of finite numbers, a copy."""
    array = any_numbers(name, value)
    if not np.isfinite(array).all():
        raise ValueError(f"{name} holds a value that is not finite: {shown(array)}.")
    return array


def any_numbers(name: str, value: Any) -> Array:
    """The value as an array of numbers, NaN and infinity allowed, a copy."""
    try:
        # Before the conversion, which would drop an imaginary part.
        if np.iscomplexobj(value):
            raise TypeError("complex")
        return np.array(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} must be numbers, not {value!r}.") from error


def vector(name: str, value: Any, size: int, of: str, *, finite: bool = True) -> Array:
    """A vector (size,); one number stands for all its entries."""
    array = numbers(name, value) if finite else any_numbers(name, value)
    if array.ndim == 0:
        return np.full(size, float(array))
    if array.shape != (size,):
        raise ValueError(f"{name} has shape {array.shape}, but there are {size} {of}: give {size} numbers.")
    return array


def exactly(name: str, value: Any, shape: tuple[int, ...]) -> Array:
    """An array of just this shape, NaN allowed: what arrives on every step."""
    array = np.atleast_1d(any_numbers(name, value))
    if array.shape != shape:
        raise ValueError(f"{name} has shape {array.shape} instead of {shape}.")
    return array


def covariance(name: str, value: Any, size: int, of: str) -> Array:
    """A covariance (size, size) from one variance, from variances (size,) or from the matrix itself.

    It may be indefinite: the controller repairs that, and says by how much.
    """
    array = numbers(name, value)
    if array.ndim < 2:
        array = np.diag(vector(name, array, size, of))
    if array.shape != (size, size):
        raise ValueError(f"{name} has shape {array.shape}, but there are {size} {of}: give ({size}, {size}).")
    if not np.allclose(array, array.T, rtol=1e-9, atol=1e-12 * np.abs(array).max()):
        raise ValueError(f"{name} is not symmetric; give (A + A.T) / 2.")
    if (np.diag(array) < 0.0).any():
        raise ValueError(f"{name} has a negative variance on its diagonal: {shown(np.diag(array))}.")
    return array


def positive_definite(name: str, value: Any, size: int, of: str) -> Array:
    """A covariance (size, size) that is positive definite as it stands."""
    array = covariance(name, value, size, of)
    smallest = float(np.linalg.eigvalsh(array)[0])
    if smallest <= 0.0:
        raise ValueError(f"{name} must be positive definite; its smallest eigenvalue is {smallest:.3g}.")
    return array


def number(
    name: str,
    value: Any,
    *,
    above: float | None = None,
    least: float | None = None,
    below: float | None = None,
) -> float:
    """One finite number inside its bounds."""
    array = numbers(name, value)
    if array.size != 1:
        raise ValueError(f"{name} must be one number, not {shown(array)}.")
    single = float(array.reshape(()))
    if above is not None and not single > above:
        raise ValueError(f"{name} is {single:g}; it must be above {above:g}.")
    if least is not None and not single >= least:
        raise ValueError(f"{name} is {single:g}; it must be at least {least:g}.")
    if below is not None and not single < below:
        raise ValueError(f"{name} is {single:g}; it must be below {below:g}.")
    return single


def count(name: str, value: Any, least: int = 1) -> int:
    """A whole number."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
        raise ValueError(f"{name} is {value!r}; it must be a whole number of at least {least}.")
    return int(value)


def bounds(minimum: Any, maximum: Any, control: Array) -> tuple[Array, Array]:
    """Lower and upper bounds (m,) around the initial control (m,)."""
    m = len(control)
    low = vector("minimum", -np.inf if minimum is None else minimum, m, "controls", finite=False)
    high = vector("maximum", np.inf if maximum is None else maximum, m, "controls", finite=False)
    if np.isnan(low).any() or np.isnan(high).any():
        raise ValueError(
            f"{'minimum' if np.isnan(low).any() else 'maximum'} holds NaN; leave a bound out with inf."
        )
    for j in range(m):
        if low[j] > high[j]:
            raise ValueError(f"minimum {low[j]:g} of control {j} is above its maximum {high[j]:g}.")
        if not low[j] <= control[j] <= high[j]:
            raise ValueError(
                f"control {j} is {control[j]:g} at the start, outside its bounds {low[j]:g} .. {high[j]:g}."
            )
    return low, high


def flag(name: str, value: Any) -> bool:
    """True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise ValueError(f"{name} is {value!r}; it must be True or False.")
    return bool(value)


def shown(array: Array) -> str:
    """The array in one line."""
    return np.array2string(array, precision=4, threshold=12, separator=", ").replace("\n", "")
