# SPDX-License-Identifier: Apache-2.0
"""`nominal`: the values that controls keep where no output needs others.

Two thrusters push the same cart. Without nominal values they drift against each other; with them the cheap one works.
"""

import numpy as np

from skydiver_utc import UnscentedTransformController


def plant(state, control, dt):
    return state + dt * (control[0] + control[1] - state)


def controls(**settings):
    """Of the two thrusters after 200 steps of a sine."""
    state = np.zeros(1)
    controller = UnscentedTransformController.of(
        plant, state=state, control=[0.5, -0.5], dt=0.05, horizon=5, minimum=-2.0, maximum=2.0, **settings
    )
    for _ in range(200):
        state = plant(state, controller.step(state, 1.0).control, 0.05)
    return controller.control, state[0]


free, _ = controls()
named, end = controls(nominal={"u0": {"variance": 10.0}, "u1": {"value": 0.0, "variance": 0.01}})
print(f"free: {free[0]:.3f} and {free[1]:.3f}; the second one held near 0: {named[0]:.3f} and {named[1]:.3f}")
