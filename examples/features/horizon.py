# SPDX-License-Identifier: Apache-2.0
"""The horizon: one step at which the output meets the reference, or several.

A plant with a dead time of 3 steps needs a horizon beyond it.
"""

import numpy as np

from skydiver_utc import UnscentedTransformController

DT = 0.1


def delayed(state, control, dt):
    """x' = -x + u three steps ago; the state is x and the last three controls, newest first."""
    x = state[0] + dt * (state[3] - state[0])
    return np.array([x, control[0], state[1], state[2]])


def end(horizon):
    """x after 6 s with 0.5 as reference."""
    state = np.zeros(4)
    controller = UnscentedTransformController.of(
        delayed, lambda x: x[0], state=state, control=0.0, dt=DT, horizon=horizon, minimum=-2.0, maximum=2.0
    )
    for _ in range(60):
        state = delayed(state, controller.step(state, 0.5).control, DT)
    return state[0]


found = {str(horizon): end(horizon) for horizon in (3, 10, [6, 12])}
print(", ".join(f"horizon {name}: {value:.3f}" for name, value in found.items()))
