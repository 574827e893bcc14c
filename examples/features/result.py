# SPDX-License-Identifier: Apache-2.0
"""The result of a step: control, covariance, status, and how many sigma points diverged, by which error."""

import numpy as np

from skydiver_utc import Status, UnscentedTransformController


def tank(state, control, dt):
    """The level falls with its root, which has no value below zero."""
    if state[0] < 0.0:
        raise ValueError("the tank is empty")
    return state + dt * (control - np.sqrt(state))


controller = UnscentedTransformController.of(
    tank, state=[0.02], control=0.1, dt=0.1, horizon=10, minimum=-1.0, maximum=1.0, Pu=0.25
)
result = controller.step([0.02], reference=0.05)
print(f"control {result.control[0]:.3f} +- {result.deviations[0]:.3f}, predicted {result.predicted[0]:.3f}")
print(f"{Status(result.status).name}: {result.lost} points lost, {result.cause}")
print(result.sentence)
