# SPDX-License-Identifier: Apache-2.0
"""From a time derivative to a step, for plants given in continuous time."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.jit import inlined

Array = NDArray[np.float64]


@inlined
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
