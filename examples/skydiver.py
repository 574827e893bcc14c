"""The skydiver's fast turn through the library: 400 deg/s at 0.2 Hz with four controls, as a user would set it up.

The plant is a Python function around the package's skydiver, its limbs held still; the coupling comes through Qu.
`skydiver-utc simulate fast_turn_unknown_dynamics` flies the same controller compiled.
"""

import numpy as np
from show import figure_path, panels

from skydiver_utc import UnscentedTransformController
from skydiver_utc.control.coupling import CouplingSchedule
from skydiver_utc.parameters import load_scenario
from skydiver_utc.simulation.build import build_plant, build_reference


def fly(seconds=6.0):
    """Time, yaw rate wanted and flown (K,) [rad/s], controls (K, 4)."""
    scenario = load_scenario("fast_turn_unknown_dynamics")
    rigid = build_plant(load_scenario("fast_turn_unknown_dynamics", {"plant.limbs.reaction": False}))
    plant, parameters, bounds = build_plant(scenario), scenario.controller, scenario.plant.limits
    count, horizon = round(seconds / scenario.dt_s), parameters.horizon_steps
    k_hyst = parameters.k_hyst(scenario.dt_s)
    wanted = build_reference(scenario).preview(0, count + max(k_hyst + 1, horizon) + 1)
    coupling = CouplingSchedule(parameters, k_hyst, scenario.dt_s)
    controller = UnscentedTransformController(
        lambda state, control, dt: rigid.step(state, control, control),
        output=lambda state: state[12],
        state=plant.initial_state(), control=plant.initial_control(), dt=scenario.dt_s, horizon=horizon,
        minimum=bounds.minimum, maximum=bounds.maximum, rate=[np.inf, np.inf, np.inf, bounds.alpha_rate],
        P_err=parameters.P_err, W0=parameters.W0, Pu=coupling.initial_covariance(wanted),
        covariance_floor=parameters.covariance_floor,
    )  # fmt: skip
    state, applied = plant.initial_state(), plant.initial_applied()
    rates, controls = [], []
    for k in range(count):
        preview = wanted[k : k + horizon + 1]
        result = controller.step(state, preview, Qu=coupling.process_noise(wanted[k:]))
        rates.append(state[12])
        controls.append(result.control)
        before, applied = applied, plant.actuate(result.control, applied)
        state = plant.step(state, before, applied)
    return scenario.dt_s * np.arange(count), wanted[:count], np.array(rates), np.array(controls)


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
