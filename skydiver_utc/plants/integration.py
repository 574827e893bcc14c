# SPDX-License-Identifier: Apache-2.0
"""From a time derivative to a step, for plants given in continuous time."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.jit import allocating, bound, is_jitted
from skydiver_utc.plants.function import writes_its_result


@allocating
def runge_kutta(
    derivative: Any, state: Array, control: Array, parameters: Any, dt_s: float, out: Array
) -> None:
    """One classical Runge-Kutta step of dt with the control (m,) held; out (n,) may be the state.

    derivative(state (n,), control, parameters, out (n,)): a kernel that writes the state's time derivative
    """
    n = state.shape[0]
    slope, probe, change = np.empty(n), state.copy(), np.zeros(n)
    for stage in range(4):
        derivative(probe, control, parameters, slope)
        share = dt_s / 6.0 if stage == 0 or stage == 3 else dt_s / 3.0
        reach = dt_s if stage == 2 else 0.5 * dt_s
        for i in range(n):
            change[i] += share * slope[i]
            probe[i] = state[i] + reach * slope[i]
    for i in range(n):
        out[i] = state[i] + change[i]


_FORM = "derivative must be a function (state, control) -> derivative, or (state, control, out)"


def rk4(derivative: Callable[..., Any]) -> Callable[[Array, Array, float], Array]:
    """The plant(state (n,), control (m,), dt) -> state of a derivative: one classical Runge-Kutta step, control held.

    For `UnscentedTransformController.of` and `FunctionPlant`. The error of a step grows with dt^5; a mode that decays
    with the rate r is stable for dt r < 2.78.

    derivative: derivative(state, control) -> time derivative (n,), or derivative(state, control, out) that writes it;
    plain Python, or jitted by numba: the step is then jitted and kept on disk, too
    ValueError for any other form.
    """
    writes = writes_its_result(derivative, 3, _FORM)
    if not is_jitted(derivative):
        return partial(_of_writing if writes else _of_returning, derivative)
    method = _OF_WRITING if writes else _OF_RETURNING
    jitted: Callable[[Array, Array, float], Array]
    jitted = bound(rk4_step, "rk4_step", derivative, method=method, derivative=derivative)
    return jitted


def _of_returning(derivative: Any, state: Array, control: Array, dt: float) -> Array:
    first = np.asarray(derivative(state, control))
    if first.size != state.size:
        raise TypeError("the derivative has another size than the state")
    second = np.asarray(derivative(state + 0.5 * dt * first, control))
    third = np.asarray(derivative(state + 0.5 * dt * second, control))
    fourth = np.asarray(derivative(state + dt * third, control))
    return state + dt / 6.0 * (first + 2.0 * (second + third) + fourth)


def _of_writing(derivative: Any, state: Array, control: Array, dt: float) -> Array:
    slopes = np.empty((4, state.size))
    derivative(state, control, slopes[0])
    derivative(state + 0.5 * dt * slopes[0], control, slopes[1])
    derivative(state + 0.5 * dt * slopes[1], control, slopes[2])
    derivative(state + dt * slopes[2], control, slopes[3])
    return state + dt / 6.0 * (slopes[0] + 2.0 * (slopes[1] + slopes[2]) + slopes[3])


_OF_RETURNING, _OF_WRITING = allocating(_of_returning), allocating(_of_writing)


def derivative(*_: Any) -> Any:
    """A name for the user's own function, which the template below integrates."""


def method(*_: Any) -> Any:
    """A name for what the template below calls, likewise."""


def rk4_step(state: Array, control: Array, dt: float) -> Any:
    """A step of one derivative."""
    return method(derivative, state, control, dt)
