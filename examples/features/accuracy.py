# SPDX-License-Identifier: Apache-2.0
"""`P_err`: the variance of the tracking error, in the output's unit squared. Small is accurate, large is calm."""

import numpy as np

from skydiver_utc import UnscentedTransformController

DT = 0.05


def plant(state, control, dt):
    return state + dt * (control - state)


def flown(P_err):
    """RMSE to a sine, and RMS change of the control per step, with a measurement noise of 0.02."""
    noise = np.random.default_rng(1)
    controller = UnscentedTransformController.of(
        plant, state=[0.0], control=0.0, dt=DT, horizon=5, minimum=-5.0, maximum=5.0, P_err=P_err
    )
    state, errors, controls = np.zeros(1), [], []
    for k in range(200):
        reference = np.sin(DT * np.arange(k, k + 6))[:, None]
        errors.append(state[0] - reference[0, 0])
        result = controller.step(state + 0.02 * noise.normal(size=1), reference)
        controls.append(result.control[0])
        state = plant(state, result.control, DT)
    return np.sqrt(np.mean(np.square(errors))), np.sqrt(np.mean(np.diff(controls) ** 2))


accurate, calm = flown(1e-4), flown(1e-1)
print(f"P_err 1e-4: RMSE {accurate[0]:.3f}, control changes by {accurate[1]:.3f} a step")
print(f"P_err 1e-1: RMSE {calm[0]:.3f}, control changes by {calm[1]:.3f} a step")
