# SPDX-License-Identifier: Apache-2.0
"""A cart-pole swings up and balances. UTC follows slopes: each phase has an output whose slope leads on.

Swing up: the pole's energy, which a hanging pole can raise at once, beside place and speed of the cart (with the
angle alone the cart would drive away). Balance: one output that takes cart and pole to rest with it, the place of
the centre of oscillation and its three derivatives with three equal poles.
"""

import numpy as np
from numba import njit
from show import figure_path, panels

from skydiver_utc import UnscentedTransformController

DT, FORCE = 0.02, 10.0
CART, POLE, LENGTH, G, RATE = 1.0, 0.2, 0.5, 9.81, 3.0  # kg, kg, m, m/s2, 1/s


@njit
def cart_pole(state, control, dt, out):
    """State: place of the cart, angle of the pole from upright, and their rates; the force on the cart in N."""
    sine, cosine = np.sin(state[1]), np.cos(state[1])
    push = (control[0] + POLE * LENGTH * state[3] ** 2 * sine) / (CART + POLE)
    turn = (G * sine - cosine * push) / (LENGTH * (1.0 - POLE * cosine**2 / (CART + POLE)))
    out[2] = state[2] + dt * (push - POLE * LENGTH * turn * cosine / (CART + POLE))
    out[3] = state[3] + dt * turn
    out[0] = state[0] + dt * out[2]
    out[1] = state[1] + dt * out[3]


@njit
def energy(state):
    """Energy of the pole over that at rest upright, in units of m g l, and place and speed of the cart."""
    return np.array([0.5 * LENGTH / G * state[3] ** 2 + np.cos(state[1]) - 1.0, state[0], state[2]])


@njit
def balance(state):
    """(d/dt + RATE)^3 of the place of the centre of oscillation, which accelerates with g times the angle."""
    angle = np.arctan2(np.sin(state[1]), np.cos(state[1]))
    place, speed = state[0] + LENGTH * angle, state[2] + LENGTH * state[3]
    return G * state[3] + 3 * RATE * G * angle + 3 * RATE**2 * speed + RATE**3 * place


def fly(seconds=8.0):
    """Time, states (K, 4), forces (K,), and whether the pole is being balanced (K,)."""
    state, common = (
        np.array([0.0, np.pi - 0.01, 0.0, 0.0]),
        {"control": 0.0, "dt": DT, "minimum": -FORCE, "maximum": FORCE},
    )
    swing = UnscentedTransformController.of(
        cart_pole, energy, state=state, horizon=20, P_err=[1e-2, 1e-1, 1.0], **common
    )
    catch = UnscentedTransformController.of(cart_pole, balance, state=state, horizon=5, P_err=1e-2, **common)
    states, forces, balanced = [], [], []
    active = swing
    for _ in range(round(seconds / DT)):
        lean = abs(np.arctan2(np.sin(state[1]), np.cos(state[1])))
        if (active is swing and lean < 0.4) or (active is catch and lean > 0.8):
            before, active = active, catch if active is swing else swing
            active.reset(before.control)
        force = active.step(state, np.zeros(3 if active is swing else 1)).control
        states.append(state)
        forces.append(force[0])
        balanced.append(active is catch)
        following = np.empty(4)
        cart_pole(state, force, DT, following)
        state = following
    return DT * np.arange(len(states)), np.array(states), np.array(forces), np.array(balanced)


def main():
    path = figure_path(__doc__)
    time, states, forces, balanced = fly()
    lean = np.arctan2(np.sin(states[:, 1]), np.cos(states[:, 1]))
    fallen = np.flatnonzero(~balanced)
    print(
        f"cart_pole: balanced from {time[fallen[-1] + 1]:.2f} s on, at the end {abs(lean[-1]):.1g} rad"
        f" from upright and {abs(states[-1, 0]):.1g} m from home"
    )
    if path:
        rows = [
            ("height of\nthe pole", {"height": np.cos(states[:, 1])}),
            ("cart [m]", {"cart": states[:, 0]}),
            ("force [N]", {"force": forces}),
        ]
        panels(path, "Cart-pole: swing-up on energy, then balance", time, rows)


if __name__ == "__main__":
    main()
