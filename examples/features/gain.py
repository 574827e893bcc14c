# SPDX-License-Identifier: Apache-2.0
"""`Pu`, `Qu`, `Qu_ratio` and `W0`: how far the sigma points reach, and so how fast the control moves.

Pu is the covariance of the control at the start, Qu what it gains in each step (`Qu_ratio` times Pu), and W0 the weight
of the central point: the others lie sqrt(m / (1 - W0)) standard deviations out.
"""

import numpy as np

from skydiver_utc import UnscentedTransformController

DT = 0.05


def plant(state, control, dt):
    return state + dt * (control - state)


def steps_to_95_percent(**settings):
    state = np.zeros(1)
    controller = UnscentedTransformController.of(
        plant, state=state, control=0.0, dt=DT, horizon=5, minimum=-5.0, maximum=5.0, P_err=1e-2, **settings
    )
    for k in range(400):
        if state[0] > 0.95:
            return k
        state = plant(state, controller.step(state, 1.0).control, DT)
    return 400


found = {
    "Pu 0.01, Qu 0": steps_to_95_percent(Pu=0.01, Qu=0.0),
    "Pu 0.01, Qu_ratio 0.1": steps_to_95_percent(Pu=0.01, Qu_ratio=0.1),
    "Pu 1, Qu 0.1, W0 0.5": steps_to_95_percent(Pu=1.0, Qu=0.1, W0=0.5),
}
print("; ".join(f"{name}: {steps} steps" for name, steps in found.items()))
