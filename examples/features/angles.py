# SPDX-License-Identifier: Apache-2.0
"""`angles`: outputs that wrap.

A ship turns from 3.0 to 3.3 rad, across pi, where its compass jumps to -pi. Without `angles` it spins.
"""

import numpy as np

from skydiver_utc import UnscentedTransformController


def ship(state, control, dt):
    heading, rate = state
    return np.array([heading + dt * rate, rate + dt * 0.5 * (control[0] - rate)])


def compass(state):
    return np.arctan2(np.sin(state[0]), np.cos(state[0]))


def turned(**settings):
    """The heading after 100 steps."""
    state = np.array([3.0, 0.0])
    controller = UnscentedTransformController.of(
        ship, compass, state=state, control=0.0, dt=0.1, horizon=12, minimum=-1.0, maximum=1.0, **settings
    )
    for _ in range(100):
        state = ship(state, controller.step(state, 3.3).control, 0.1)
    return state[0]


lost, held = turned(), turned(angles=["y0"])
print(f"heading wanted 3.3 rad: {lost:.2f} without angles, {held:.2f} with")
