# SPDX-License-Identifier: Apache-2.0
"""The equations of motion against Pinocchio's free body, with force and moment from the oracle."""

import aerodynamics as oracle
import numpy as np
import pytest
from skydivers import (
    joint_angles,
    model_of,
    oracle_constants,
    oracle_posture,
    random_control,
    random_state,
    skydiver,
)

from skydiver_utc.body.segments import build_body
from skydiver_utc.plants.skydiver.dynamics import invert_inertia, state_derivative
from skydiver_utc.plants.skydiver.model import held_row

pinocchio = pytest.importorskip("pinocchio", reason="needs the wheel `pin`")

POSTURES = ("neutral", "back_to_earth", "head_down")
SCENARIOS = {name: skydiver("fast_turn_unknown_dynamics", posture=name) for name in POSTURES}
MODELS = {name: model_of(scenario) for name, scenario in SCENARIOS.items()}


@pytest.mark.parametrize("name", POSTURES)
@pytest.mark.parametrize("seed", range(10))
def test_accelerations_agree(name, seed):
    """In body axes, linear before angular."""
    rng = np.random.default_rng(seed)
    scenario = SCENARIOS[name]
    control = random_control(rng, scenario)
    angles, body = joint_angles(scenario, control[3]), build_body(scenario.plant.subject)
    geometry, inverse = held_row(body, angles), np.empty(6)
    invert_inertia(geometry, inverse)
    state, derivative = random_state(rng), np.empty(13)
    state_derivative(MODELS[name], geometry, inverse, control, state, derivative)
    posture, constants = oracle_posture(scenario, angles), oracle_constants(scenario)
    wrench = np.concatenate(oracle.force_and_moment(state[7:10], state[10:], control, posture, constants))
    body = pinocchio.Model()
    body.gravity.linear = np.array([0.0, 0.0, -9.80665])
    joint = body.addJoint(0, pinocchio.JointModelFreeFlyer(), pinocchio.SE3.Identity(), "body")
    inertia = pinocchio.Inertia(posture.m, np.zeros(3), posture.inertia)
    body.appendBodyToJoint(joint, inertia, pinocchio.SE3.Identity())
    expected = pinocchio.aba(body, body.createData(), state[:7], state[7:], wrench)
    np.testing.assert_allclose(derivative[7:], expected, rtol=1e-8, atol=1e-8)
