# SPDX-License-Identifier: Apache-2.0
"""`forgetting_factor` and `covariance_floor`: the limits of Pu where an output does not see every control.

Only the sum of two controls acts. The variance of their difference grows by Qu in each step, until its sigma points are
clipped at the bounds; with a factor f it settles at Qu / f. The floor keeps the smallest eigenvalue above zero.
"""

import numpy as np

from skydiver_utc import UnscentedTransformController


def plant(state, control, dt):
    return state + dt * (control[0] + control[1] - state)


def unseen(**settings):
    """Variance of the difference of the controls after 300 steps, and the smallest eigenvalue of Pu."""
    state = np.zeros(1)
    controller = UnscentedTransformController.of(
        plant,
        state=state,
        control=[0.0, 0.0],
        dt=0.05,
        horizon=5,
        minimum=-9.0,
        maximum=9.0,
        Pu=0.01,
        Qu=1e-2,
        **settings,
    )
    for _ in range(300):
        state = plant(state, controller.step(state, 1.0).control, 0.05)
    Pu = controller.Pu
    return 0.5 * (Pu[0, 0] + Pu[1, 1] - 2.0 * Pu[0, 1]), np.linalg.eigvalsh(Pu)[0]


kept, forgotten = unseen(), unseen(forgetting_factor=0.05)
print(f"variance of the difference {kept[0]:.3g}, with forgetting {forgotten[0]:.3g}")
