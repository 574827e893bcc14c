# SPDX-License-Identifier: Apache-2.0
"""The ADMIRE fighter of arXiv 2504.08579: roll, pitch and yaw rate by canard, two elevons and rudder.

Four controls for three outputs: the covariance of U sorts out which surfaces do what. The surfaces have bounds.
"""

import numpy as np
from numba import njit
from show import figure_path, panels

from skydiver_utc import UnscentedTransformController

DT, HORIZON = 0.02, 5
A = np.array([[-0.9967, 0.0, 0.6176], [0.0, -0.5057, 0.0], [-0.0939, 0.0, -0.2127]])
B = np.array(
    [[0.0, -4.2423, 4.2423, 1.4871], [1.6532, -1.2735, -1.2735, 0.0024], [0.0, -0.2805, 0.2805, -0.8823]]
)
LOWEST, HIGHEST = np.deg2rad([-25.0, -25.0, -25.0, -30.0]), np.deg2rad([55.0, 25.0, 25.0, 30.0])


@njit
def admire(state, control, dt, out):
    """Rates p, q, r [rad/s] under canard, right and left elevon, rudder [rad]; two half steps (midpoint rule)."""
    for half in range(2):
        at = state if half == 0 else out.copy()
        span = 0.5 * dt if half == 0 else dt
        for i in range(3):
            change = 0.0
            for j in range(3):
                change += A[i, j] * at[j]
            for j in range(4):
                change += B[i, j] * control[j]
            out[i] = state[i] + span * change


def rates_wanted(time):
    """A roll to and fro, a pull and a push, a yaw rate of zero [rad/s], (K, 3), with smooth edges."""
    edge = lambda start: 0.5 * (1.0 + np.tanh((time - start) / 0.15))  # noqa: E731
    roll = edge(1.0) - 2.0 * edge(3.0) + edge(5.0)
    pitch = 0.3 * (edge(4.0) - 2.0 * edge(6.0) + edge(8.0))
    return np.stack([roll, pitch, 0.0 * time], axis=1)


def fly(seconds=10.0):
    """Time, rates wanted (K, 3), rates flown (K, 3), surfaces (K, 4)."""
    time = np.arange(0.0, seconds, DT)
    wanted = rates_wanted(np.append(time, time[-1] + DT * np.arange(1, HORIZON + 1)))
    state = np.zeros(3)
    controller = UnscentedTransformController.of(
        admire, state=state, control=np.zeros(4), dt=DT, horizon=HORIZON, minimum=LOWEST, maximum=HIGHEST
    )
    states, surfaces = [], []
    for k in range(len(time)):
        result = controller.step(state, wanted[k : k + HORIZON + 1])
        states.append(state)
        surfaces.append(result.control)
        following = np.empty(3)
        admire(state, result.control, DT, following)
        state = following
    return time, wanted[: len(time)], np.array(states), np.array(surfaces)


def main():
    path = figure_path(__doc__)
    time, wanted, states, surfaces = fly()
    errors = np.rad2deg(np.sqrt(np.mean((states - wanted) ** 2, axis=0)))
    print(f"admire: RMSE of roll, pitch, yaw rate {errors[0]:.2g}, {errors[1]:.2g}, {errors[2]:.2g} deg/s")
    if path:
        names = ("roll", "pitch", "yaw")
        rows = [
            (
                f"{name} rate\n[deg/s]",
                {name: np.rad2deg(states[:, i]), "reference": np.rad2deg(wanted[:, i])},
            )
            for i, name in enumerate(names)
        ]
        surfaces_deg = np.rad2deg(surfaces)
        curves = {name: surfaces_deg[:, j] for j, name in enumerate(("canard", "right", "left", "rudder"))}
        panels(path, "ADMIRE: body rates", time, [*rows, ("surfaces [deg]", curves)])


if __name__ == "__main__":
    main()
