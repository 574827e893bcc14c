# SPDX-License-Identifier: Apache-2.0
"""The plant of a run with other numbers than its model."""

from typing import Any

import numpy as np
import pytest
from runs import cart

from skydiver_utc.loop.build import build_plant, build_true_plant, model_beside
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.parameters import ParameterError, from_yaml, load_scenario, override, to_yaml
from skydiver_utc.plants.protocol import Plant
from skydiver_utc.plants.skydiver.model import build_model
from skydiver_utc.plants.skydiver.steady import straight_falls

NAME = "fast_turn_pi_dynamics"
CONTROL = np.array([0.5, 0.2, 0.1, 0.8])


def true_plant(name: str = NAME, **changes: Any) -> Plant:
    """The plant of the run; `ratios__mass=1.1` is truth.ratios.mass."""
    return build_true_plant(
        load_scenario(name, {f"truth.{key.replace('__', '.')}": value for key, value in changes.items()})
    )


def accelerations(plant: Plant, control: np.ndarray = CONTROL, rates: Any = (0.0, 0.0, 0.0)) -> np.ndarray:
    """Linear and angular ones (6,) in body axes, in a fall with body rates [rad/s], over a very short step."""
    state, following = plant.initial_state(), np.empty(13)
    state[10:13] = rates
    plant.model_of_step(1e-6).bound(4, 4).step(state, control, following)
    return np.asarray((following - state)[7:13] * 1e6)


@pytest.mark.parametrize(
    ("ratio", "value", "expected"),
    [("mass", 1.1, 1.1**0.5), ("drag_area", 0.9, 0.9**-0.5), ("inertia", 2.0, 1.0)],
)
def test_the_terminal_speed_is_the_root_of_mass_over_drag_area(
    ratio: str, value: float, expected: float
) -> None:
    speeds = [
        straight_falls(plant.constants)[0].speed
        for plant in (true_plant("bank_recovery"), true_plant("bank_recovery", **{f"ratios__{ratio}": value}))
    ]
    assert speeds[1] / speeds[0] == pytest.approx(expected, rel=1e-6)


def test_inertia_divides_the_angular_acceleration_and_nothing_else() -> None:
    usual, heavy = accelerations(true_plant()), accelerations(true_plant(ratios__inertia=1.25))
    np.testing.assert_allclose(heavy, usual / [1.0, 1.0, 1.0, 1.25, 1.25, 1.25], rtol=1e-4)


def test_a_ratio_of_damping_is_that_of_its_coefficient() -> None:
    rates = (1.0, -2.0, 3.0)
    ratios = true_plant(ratios={"roll_damping": 0.5, "pitch_damping": 3.0, "yaw_damping": 2.0})
    damping = load_scenario(NAME).plant.damping
    absolute = true_plant(
        damping__Cm_damp_roll=0.5 * damping.Cm_damp_roll, damping__Cm_damp_pitch=3.0 * damping.Cm_damp_pitch
    )
    twice = CONTROL * [2.0, 1.0, 1.0, 1.0]
    np.testing.assert_allclose(
        accelerations(ratios, rates=rates), accelerations(absolute, twice, rates), rtol=1e-6
    )


@pytest.mark.parametrize("name", [NAME, "front_layout"])
def test_the_pattern_s_ratio_moves_the_joints_by_as_much(name: str) -> None:
    usual, weak = true_plant(name), true_plant(name, ratios__pattern=0.8)
    rest, moved, less = (
        plant.joint_angles(np.array([0.5, 0.0, 0.0, alpha, 0.0]))
        for plant, alpha in ((usual, 0.0), (usual, 0.4), (weak, 0.4))
    )
    np.testing.assert_allclose(less - rest, 0.8 * (moved - rest), atol=1e-12)
    weak_settings = load_scenario(name, {"truth.ratios.pattern": 0.8}).true_plant
    np.testing.assert_array_equal(build_model(weak_settings, 0.01).geometry, weak.constants.geometry)


def test_actuators_follow_a_step_with_the_lag_s_time_constant() -> None:
    """On any plant; and the controller's model has no lag, so that the command is the same."""
    held = {"reference": {"kind": "constant", "values": {"force": 2.0}}, "truth.actuator_lag_s": 0.4}
    run = simulate(override(cart(), held))
    since = 0.05 * np.arange(1, 81)
    np.testing.assert_allclose(run.applied[:, 0], 2.0 * (1.0 - np.exp(-since / 0.4)), rtol=1e-12)
    np.testing.assert_array_equal(run.commands, 2.0)


def test_the_controller_predicts_with_the_model() -> None:
    """It decides alike at the same state, whatever flies, and otherwise as soon as the states differ."""
    usual, other = (
        simulate(load_scenario(NAME, {"duration_s": 0.05} | changes))
        for changes in ({}, {"truth.ratios.inertia": 1.5})
    )
    np.testing.assert_array_equal(usual.commands[0], other.commands[0])
    assert (usual.states[2] != other.states[2]).any()
    assert (usual.commands[2] != other.commands[2]).any()


def test_without_a_truth_the_plant_is_built_once() -> None:
    scenario = load_scenario(NAME)
    plant = build_true_plant(scenario)
    assert model_beside(plant, scenario) is plant
    other = load_scenario(NAME, {"truth.subject": "heavy"})
    model, heavy = model_beside(build_true_plant(other), other), build_true_plant(other)
    assert model.constants.mass < heavy.constants.mass


def test_the_start_differs_from_that_of_the_model() -> None:
    start = {"bank_deg": 30.0, "roll_rate_deg_s": 10.0, "pitch_rate_deg_s": -20.0, "fall_speed_m_s": 50.0}
    state = true_plant(initial=start).initial_state()
    np.testing.assert_allclose(np.rad2deg(state[10:12]), [10.0, -20.0])
    assert np.linalg.norm(state[7:10]) == pytest.approx(50.0)
    np.testing.assert_array_equal(
        build_plant(load_scenario(NAME, {"truth.initial": start})).initial_state(),
        true_plant().initial_state(),
    )


def test_a_truth_survives_yaml() -> None:
    scenario = load_scenario(
        NAME, {"truth.subject": "heavy", "truth.ratios.mass": 1.1, "plant.initial.bank_deg": 5.0}
    )
    again = from_yaml(to_yaml(scenario))
    assert again == scenario
    assert again.true_plant == scenario.true_plant
    assert again.true_plant.initial.bank_deg == 5.0


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("truth.ratios.mas", 1.1),
        ("truth.ratios.mass", 11.0),
        ("truth.ratios.mass", "much"),
        ("truth.actuator_lag_s", -0.1),
        ("truth.actuator_lag", 0.1),
        ("truth.initial.Cm_damp_yaw", 50.0),
        ("truth.subject", "nobody"),
    ],
)
def test_a_wrong_truth_is_refused_by_name(name: str, value: object) -> None:
    last = name.split(".")[-1]
    with pytest.raises(ParameterError, match=last):
        load_scenario(NAME, {name: value})


def test_a_truth_with_other_names_is_refused() -> None:
    scenario = override(cart(), {"truth.states": ["place", "velocity"]})
    with pytest.raises(ParameterError, match="state names"):
        simulate(scenario)
