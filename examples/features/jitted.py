# SPDX-License-Identifier: Apache-2.0
"""A jitted plant and output: the prediction is compiled, and kept on disk for the next process."""

from time import perf_counter

import numpy as np
from numba import njit

from skydiver_utc import UnscentedTransformController, rk4


@njit
def derivative(state, control):
    return np.array([state[1], control[0] - 9.81 * np.sin(state[0])])


@njit
def angle(state):
    return state[0]


pendulum, state = rk4(derivative), np.zeros(2)
controller = UnscentedTransformController.of(
    pendulum, angle, state=state, control=0.0, dt=0.01, horizon=20, minimum=-15.0, maximum=15.0
)
start = perf_counter()
for _ in range(300):
    state = pendulum(state, controller.step(state, 1.0).control, 0.01)
print(f"angle {state[0]:.4f} rad, {1e6 * (perf_counter() - start) / 300:.0f} us a step")
