# SPDX-License-Identifier: Apache-2.0
"""`explain`, and what can be set between steps: P_err, Qu, minimum, maximum, rate, dt."""

import copy

import numpy as np

from skydiver_utc import UnscentedTransformController


def cart(state, control, dt):
    return np.array([state[0] + dt * state[1], state[1] + dt * (control[0] + 0.1 * control[1])])


controller = UnscentedTransformController.of(
    cart, lambda x: x[0], state=[0.0, 0.0], control=[0.0, 0.0], dt=0.1, horizon=8, minimum=-1.0, maximum=1.0
)
explanation = controller.explain([0.0, 0.0], 0.2)
print(explanation)

frozen = copy.deepcopy(controller)
frozen.minimum, frozen.maximum = [-1.0, 0.0], [1.0, 0.0]
result = frozen.step([0.0, 0.0], 0.2)
print(f"with the second control frozen: {result.control.round(3)}, {result.status}")
print(f"free: {controller.step([0.0, 0.0], 0.2).control.round(3)}")
