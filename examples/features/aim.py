# SPDX-License-Identifier: Apache-2.0
"""`aim="tangent"`: the target is the present value and slope of the reference, continued to the horizon.

For a reference that is known one step ahead only.
"""

import numpy as np

from skydiver_utc import UnscentedTransformController

DT, N = 0.05, 6


def plant(state, control, dt):
    return state + dt * (control - state)


def rmse(**settings):
    state, errors = np.zeros(1), []
    controller = UnscentedTransformController.of(
        plant, state=state, control=0.0, dt=DT, horizon=N, minimum=-5.0, maximum=5.0, **settings
    )
    for k in range(200):
        now, following = np.sin(2.0 * DT * k), np.sin(2.0 * DT * (k + 1))
        reference = np.array([now] + N * [following])[:, None]
        errors.append(state[0] - now)
        state = plant(state, controller.step(state, reference).control, DT)
    return np.sqrt(np.mean(np.square(errors)))


end_point, tangent = rmse(), rmse(aim="tangent")
print(f"RMSE {end_point:.3f} with the last known value held, {tangent:.3f} along the tangent")
