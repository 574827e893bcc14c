# SPDX-License-Identifier: Apache-2.0
"""`after_reference`: controls to hold, without feedback, once the reference has moved and is zero from then on."""

import numpy as np

from skydiver_utc import UnscentedTransformController

DT, N = 0.05, 5


def plant(state, control, dt):
    return state + dt * (control - state)


state = np.zeros(1)
controller = UnscentedTransformController.of(
    plant, state=state, control=0.0, dt=DT, horizon=N, minimum=-5.0, maximum=5.0, rate=10.0,
    after_reference={"u0": -0.5},
)  # fmt: skip
wanted = np.concatenate([np.sin(np.linspace(0.0, np.pi, 60)), np.zeros(60 + N)])
wanted[59:] = 0.0
for k in range(119):
    result = controller.step(state, wanted[k : k + N + 1, None])
    state = plant(state, result.control, DT)
print(f"control {result.control[0]:.3f} at the end")
