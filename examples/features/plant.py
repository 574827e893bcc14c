# SPDX-License-Identifier: Apache-2.0
"""The plant: a function that returns the next state, one that writes it, or `rk4` of a derivative."""

import numpy as np

from skydiver_utc import UnscentedTransformController, rk4


def returning(state, control, dt):
    """x' = -x + u, exactly."""
    decay = np.exp(-dt)
    return decay * state + (1.0 - decay) * control


def writing(state, control, dt, out):
    out[:] = returning(state, control, dt)


def derivative(state, control):
    return -state + control


controls = []
for plant in (returning, writing, rk4(derivative)):
    controller = UnscentedTransformController.of(
        plant, state=[0.0], control=0.0, dt=0.05, horizon=5, minimum=-2.0, maximum=2.0
    )
    controls.append(controller.step([0.0], reference=0.2).control[0])
print(f"control {controls[0]:.6f}, {controls[1]:.6f}, {controls[2]:.6f}")
