# SPDX-License-Identifier: Apache-2.0
"""The quadcopter of arXiv 2504.08579 (1 kg; .2, .2, .3 kg m2) climbs a helix, 12 states, thrust and three torques.

A torque moves the place only through four integrations, so the outputs are (d/dt + RATE)^3 of the two horizontal
places and (d/dt + RATE) of height and heading: once these are met, the places follow.
"""

import numpy as np
from numba import njit
from show import figure_path, panels

from skydiver_utc import UnscentedTransformController

DT, HORIZON, RATE, G = 0.01, 10, 3.0, 9.81
INERTIA = np.array([0.2, 0.2, 0.3])


@njit
def quadcopter(state, control, dt, out):
    """State: place, velocity (world), roll, pitch, yaw, body rates. Controls: thrust [N], three torques [Nm]."""
    roll, pitch, yaw, p, q, r = state[6], state[7], state[8], state[9], state[10], state[11]
    lean = np.cos(roll) * np.sin(pitch)
    out[3] = state[3] + dt * control[0] * (lean * np.cos(yaw) + np.sin(roll) * np.sin(yaw))
    out[4] = state[4] + dt * control[0] * (lean * np.sin(yaw) - np.sin(roll) * np.cos(yaw))
    out[5] = state[5] + dt * (control[0] * np.cos(roll) * np.cos(pitch) - G)
    out[9] = p + dt * (control[1] + (INERTIA[1] - INERTIA[2]) * q * r) / INERTIA[0]
    out[10] = q + dt * (control[2] + (INERTIA[2] - INERTIA[0]) * p * r) / INERTIA[1]
    out[11] = r + dt * (control[3] + (INERTIA[0] - INERTIA[1]) * p * q) / INERTIA[2]
    around = np.sin(roll) * out[10] + np.cos(roll) * out[11]
    out[6] = roll + dt * (out[9] + np.tan(pitch) * around)
    out[7] = pitch + dt * (np.cos(roll) * out[10] - np.sin(roll) * out[11])
    out[8] = yaw + dt * around / np.cos(pitch)
    for i in range(3):
        out[i] = state[i] + dt * out[3 + i]


@njit
def outputs(state):
    """Near level flight with heading zero, places accelerate with g pitch and -g roll."""
    x = G * state[10] + 3 * RATE * G * state[7] + 3 * RATE**2 * state[3] + RATE**3 * state[0]
    y = -G * state[9] - 3 * RATE * G * state[6] + 3 * RATE**2 * state[4] + RATE**3 * state[1]
    return np.array([x, y, state[5] + RATE * state[2], state[11] + RATE * state[8]])


def helix(time):
    """Places (3, K) wanted, and what the outputs are on them (K, 4)."""
    radius, turn, climb = 2.0, 0.8, 0.3
    circle = radius * np.exp(1j * turn * time)  # x + i y
    wanted = (1j * turn + RATE) ** 3 * circle
    height = climb * time
    places = np.stack([circle.real, circle.imag, height])
    return places, np.stack([wanted.real, wanted.imag, climb + RATE * height, 0.0 * time], axis=1)


def fly(seconds=16.0):
    """Time, places wanted (3, K), states (K, 12), controls (K, 4); starts at rest in the middle of the circle."""
    time = DT * np.arange(round(seconds / DT) + HORIZON + 1)
    places, wanted = helix(time)
    state = np.zeros(12)
    controller = UnscentedTransformController.of(
        quadcopter, outputs, state=state, control=[G, 0, 0, 0], dt=DT, horizon=HORIZON,
        minimum=[0, -1, -1, -1], maximum=[20, 1, 1, 1], P_err=[1.0, 1.0, 1e-3, 1e-3],
    )  # fmt: skip
    states, controls = [], []
    for k in range(round(seconds / DT)):
        result = controller.step(state, wanted[k : k + HORIZON + 1])
        states.append(state)
        controls.append(result.control)
        following = np.empty(12)
        quadcopter(state, result.control, DT, following)
        state = following
    return time[: len(states)], places[:, : len(states)], np.array(states), np.array(controls)


def main():
    path = figure_path(__doc__)
    time, places, states, controls = fly()
    distance = np.linalg.norm(states[:, :3] - places.T, axis=1)
    print(f"quadcopter: from 6 s on at most {distance[time > 6].max():.2g} m from the helix of 2 m radius")
    if path:
        rows = [(f"{name} [m]", {name: states[:, i], "reference": places[i]}) for i, name in enumerate("xyz")]
        torques = {name: controls[:, 1 + i] for i, name in enumerate(("roll", "pitch", "yaw"))}
        panels(path, "Quadcopter: a helix from rest", time, [*rows, ("torque [Nm]", torques)])


if __name__ == "__main__":
    main()
