# SPDX-License-Identifier: Apache-2.0
"""`offset_share`: offset-free tracking where the model is wrong.

A tank whose pump gives 20 % less than the model's. The share is what is taken up in each step of the difference between
the measured level and that of the model: begin with 0.1; more is faster and passes on more noise.
"""

import numpy as np

from skydiver_utc import UnscentedTransformController


def tank(state, control, dt, pump=1.0):
    return state + dt * (pump * control - 0.4 * np.sqrt(np.maximum(state, 0.0)))


def level(share):
    """The level after 600 steps."""
    state = np.array([1.0])
    controller = UnscentedTransformController.of(
        tank, state=state, control=0.4, dt=0.1, horizon=8, minimum=0.0, maximum=2.0, offset_share=share
    )
    for _ in range(600):
        state = tank(state, controller.step(state, 2.0).control, 0.1, pump=0.8)
    return state[0]


plain, offset_free = level(0.0), level(0.1)
print(f"level wanted 2: {plain:.3f}, offset-free {offset_free:.3f}")
