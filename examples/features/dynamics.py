# SPDX-License-Identifier: Apache-2.0
"""`dynamics`: how a control moves inside the horizon, here towards the sigma point with the lag of an actuator."""

import numpy as np

from skydiver_utc import UnscentedTransformController

DT, LAG = 0.05, 0.3


def plant(state, control, dt):
    return state + dt * control


def lagging(point, control, state, preview, j):
    """The control on step j of the horizon, from the one before and the sigma point."""
    return control + DT / LAG * (point - control)


def flown(dynamics):
    """Largest change of the control in a step, and the error at the end."""
    state, controls = np.zeros(1), [0.0]
    controller = UnscentedTransformController.of(
        plant, state=state, control=0.0, dt=DT, horizon=8, minimum=-2.0, maximum=2.0, dynamics=dynamics
    )
    for _ in range(100):
        result = controller.step(state, 1.0)
        state = plant(state, result.control, DT)
        controls.append(result.control[0])
    return np.abs(np.diff(controls)).max(), abs(state[0] - 1.0)


held, lag = flown(None), flown(lagging)
print(f"largest change of the control in a step: {held[0]:.2f} held, {lag[0]:.2f} with the lag")
