# SPDX-License-Identifier: Apache-2.0
"""`step(..., Qu=)`: what Pu gains in this step only, for example more when the reference jumps."""

import numpy as np

from skydiver_utc import UnscentedTransformController

DT = 0.05


def plant(state, control, dt):
    return state + dt * (control - state)


def rmse(at_the_jump):
    state, errors = np.zeros(1), []
    controller = UnscentedTransformController.of(
        plant,
        state=state,
        control=0.0,
        dt=DT,
        horizon=5,
        minimum=-5.0,
        maximum=5.0,
        P_err=1e-4,
        Pu=1e-3,
        Qu=1e-4,
    )
    for k in range(100):
        reference, jumps = float(k >= 50), k == 50
        errors.append(state[0] - reference)
        result = controller.step(state, reference, Qu=[[at_the_jump]] if jumps else None)
        state = plant(state, result.control, DT)
    return np.sqrt(np.mean(np.square(errors)))


usual, raised = rmse(1e-4), rmse(1.0)
print(f"RMSE {usual:.3f} with the usual Qu, {raised:.3f} with more at the jump")
