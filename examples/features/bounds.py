# SPDX-License-Identifier: Apache-2.0
"""`minimum`, `maximum` and `rate`: the control respects them in every step, and so does the prediction."""

import numpy as np

from skydiver_utc import UnscentedTransformController

DT = 0.1


def plant(state, control, dt):
    return state + dt * (control - state)


controller = UnscentedTransformController.of(
    plant, state=[0.0], control=0.0, dt=DT, horizon=5, minimum=-1.0, maximum=2.0, rate=4.0
)
state, controls = np.zeros(1), [0.0]
for k in range(60):
    result = controller.step(state, reference=1.5 if k < 30 else -2.0)
    state = plant(state, result.control, DT)
    controls.append(result.control[0])
steepest = np.abs(np.diff(controls)).max() / DT
print(f"control {min(controls):.3f} .. {max(controls):.3f}, at most {steepest:.3f} per second")
print(result.sentence)
