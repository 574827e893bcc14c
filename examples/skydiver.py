# SPDX-License-Identifier: Apache-2.0
"""The skydiver's fast turn through the library: 400 deg/s at 0.2 Hz with four controls, as a user would set it up.

The model is a Python function around the package's skydiver, its limbs held still; the law's numbers and the paper's
coupling are those of the scenario, which take the controls by their names.
`skydiver-utc simulate fast_turn_unknown_dynamics` flies the same controller compiled.
"""

import numpy as np
from show import figure_path, panels

from skydiver_utc import FunctionPlant, UnscentedTransformController
from skydiver_utc.loop.build import build_plant, build_reference
from skydiver_utc.parameters import load_scenario


def fly(seconds=6.0):
    """Time, yaw rate wanted and flown (K,) [rad/s], controls (K, 4)."""
    scenario = load_scenario("fast_turn_unknown_dynamics")
    rigid = build_plant(load_scenario("fast_turn_unknown_dynamics", {"plant.limbs.reaction": False}))
    plant, dt = build_plant(scenario), scenario.dt_s
    model = FunctionPlant(
        lambda state, control, dt: rigid.step(state, control, control),
        output=lambda state: state[12],
        state=plant.initial_state(), control=plant.initial_control(), dt=dt,
        minimum=plant.minimum, maximum=plant.maximum, rate=plant.rate, control_names=plant.control_names,
    )  # fmt: skip
    controller = UnscentedTransformController(scenario.controller, model)
    count, width = round(seconds / dt), controller.preview_steps + 1
    wanted = build_reference(scenario).preview(0, count + width)
    state, applied = plant.initial_state(), plant.initial_applied()
    rates, controls = [], []
    for k in range(count):
        result = controller.step(state, wanted[k : k + width])
        rates.append(state[12])
        controls.append(result.control)
        state, applied = plant.advance(state, applied, result.control)
    return dt * np.arange(count), wanted[:count, 0], np.array(rates), np.array(controls)


def main():
    path = figure_path(__doc__)
    time, wanted, rates, controls = fly()
    error = np.rad2deg(rates - wanted)[time > 2.0]
    print(f"skydiver: yaw rate within {np.abs(error).max():.2g} deg/s of the reference from 2 s on")
    if path:
        rows = [("yaw rate\n[deg/s]", {"yaw rate": np.rad2deg(rates), "reference": np.rad2deg(wanted)})]
        names = ("yaw damping", "right hand", "left hand", "alpha [rad]")
        rows += [("controls", {name: controls[:, j] for j, name in enumerate(names)})]
        panels(path, "Skydiver: the fast turn", time, rows)


if __name__ == "__main__":
    main()
