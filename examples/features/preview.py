# SPDX-License-Identifier: Apache-2.0
"""`step(state, reference)`: one value, or a preview (N+1, l), with which the output is not late."""

import numpy as np

from skydiver_utc import UnscentedTransformController

DT, N = 0.05, 6


def plant(state, control, dt):
    return state + dt * (control - state)


def rmse(preview):
    state, errors = np.zeros(1), []
    controller = UnscentedTransformController.of(
        plant, state=state, control=0.0, dt=DT, horizon=N, minimum=-5.0, maximum=5.0
    )
    for k in range(200):
        reference = np.sin(2.0 * DT * np.arange(k, k + N + 1))[:, None]
        errors.append(state[0] - reference[0, 0])
        state = plant(state, controller.step(state, reference if preview else reference[0]).control, DT)
    return np.sqrt(np.mean(np.square(errors)))


one, ahead = rmse(preview=False), rmse(preview=True)
print(f"RMSE {one:.3f} with the value of now, {ahead:.3f} with a preview")
