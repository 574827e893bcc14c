# SPDX-License-Identifier: Apache-2.0
"""The output: of a cart its place, or its place and speed as one output, y + T y'.

A force moves the place only through two integrations: over a short horizon it hardly sees the force. With T above the
horizon the output answers to the force at once, and the place follows like exp(-t / T).
"""

import numpy as np

from skydiver_utc import UnscentedTransformController

DT, T = 0.05, 0.4


def cart(state, control, dt):
    return np.array([state[0] + dt * state[1] + 0.5 * dt**2 * control[0], state[1] + dt * control[0]])


def largest_late_error(output):
    """After 4 s, with the place wanted at 1 m."""
    state, places = np.zeros(2), []
    controller = UnscentedTransformController.of(
        cart, output, state=state, control=0.0, dt=DT, horizon=2, minimum=-10.0, maximum=10.0, P_err=1e-4
    )
    for _ in range(160):
        state = cart(state, controller.step(state, reference=1.0).control, DT)
        places.append(state[0])
    return np.abs(np.array(places[80:]) - 1.0).max()


alone, with_speed = largest_late_error(lambda x: x[0]), largest_late_error(lambda x: x[0] + T * x[1])
print(f"error after 4 s: {alone:.2g} m of the place alone, {with_speed:.2g} m of y + T y'")
