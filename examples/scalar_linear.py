# SPDX-License-Identifier: Apache-2.0
"""The smallest plant there is: x' = x + u, unstable, followed along steps that the bound on u makes hard.

Plain Python, no compilation. The standard deviation of U is what UTC knows about its control.
"""

import numpy as np
from show import figure_path, panels

from skydiver_utc import UnscentedTransformController

DT, HORIZON, LARGEST = 0.05, 4, 2.0


def plant(state, control, dt):
    """Exact over one step."""
    growth = np.exp(dt)
    return growth * state + (growth - 1.0) * control


def fly(seconds=8.0):
    """Time, reference, states and controls, each one row per step, and the standard deviations of U."""
    time = np.arange(0.0, seconds, DT)
    reference = np.where(time % 4.0 < 2.0, 1.0, -0.5)
    state = np.array([0.0])
    controller = UnscentedTransformController.of(
        plant, state=state, control=0.0, dt=DT, horizon=HORIZON, minimum=-LARGEST, maximum=LARGEST
    )
    states, controls, deviations = [], [], []
    for wanted in reference:
        result = controller.step(state, wanted)
        states.append(state[0])
        controls.append(result.control[0])
        deviations.append(result.deviations[0])
        state = plant(state, result.control, DT)
    return time, reference, np.array(states), np.array(controls), np.array(deviations)


def main():
    path = figure_path(__doc__)
    time, reference, states, controls, deviations = fly()
    last = np.abs(states - reference)[(time % 2.0) > 1.5].max()
    print(
        f"scalar_linear: error in the last 0.5 s of each step at most {last:.2g},"
        f" u at most {np.abs(controls).max():g}"
    )
    if path:
        rows = [
            ("x", {"x": states, "reference": reference}),
            ("u", {"u": controls}),
            ("std of U", {"std of U": deviations}),
        ]
        panels(path, "x' = x + u, |u| <= 2, horizon of 4 steps", time, rows)


if __name__ == "__main__":
    main()
