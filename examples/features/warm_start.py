# SPDX-License-Identifier: Apache-2.0
"""`reset(control, Pu)`: a controller goes on where another one stopped."""

import numpy as np

from skydiver_utc import UnscentedTransformController


def plant(state, control, dt):
    return state + dt * (control - state)


def controller():
    return UnscentedTransformController.of(
        plant, state=[0.0], control=0.0, dt=0.05, horizon=5, minimum=-5.0, maximum=5.0
    )


first, state = controller(), np.zeros(1)
for _ in range(50):
    state = plant(state, first.step(state, 1.0).control, 0.05)
second = controller()
second.reset(first.control, first.Pu)
difference = abs(first.step(state, 1.2).control[0] - second.step(state, 1.2).control[0])
print(f"the two controls differ by {difference:.1g}")
