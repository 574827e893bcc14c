# SPDX-License-Identifier: Apache-2.0
"""The equations of motion against Pinocchio's free body, with force and moment from the oracle."""

import aerodynamics as oracle
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from skydivers import (
    joint_angles,
    model_of,
    oracle_constants,
    oracle_posture,
    random_control,
    random_state,
    skydiver,
    step_of,
)

from skydiver_utc.body.segments import build_body
from skydiver_utc.plants.skydiver.dynamics import invert_inertia, state_derivative
from skydiver_utc.plants.skydiver.model import held_row

pinocchio = pytest.importorskip("pinocchio", reason="needs the wheel `pin`")

POSTURES = ("neutral", "back_to_earth", "head_down")
SCENARIOS = {name: skydiver("fast_turn_unknown_dynamics", posture=name) for name in POSTURES}
MODELS = {name: model_of(scenario) for name, scenario in SCENARIOS.items()}


class FreeBody:
    """A free rigid body in Pinocchio; velocity, wrench and acceleration in body axes, linear before angular."""

    def __init__(self, posture):
        self.model = pinocchio.Model()
        self.model.gravity.linear = np.array([0.0, 0.0, -9.80665])
        joint = self.model.addJoint(0, pinocchio.JointModelFreeFlyer(), pinocchio.SE3.Identity(), "body")
        inertia = pinocchio.Inertia(posture.m, np.zeros(3), posture.inertia)
        self.model.appendBodyToJoint(joint, inertia, pinocchio.SE3.Identity())
        self.data = self.model.createData()

    def acceleration(self, state, wrench):
        configured = state[:7].copy()
        configured[3:] /= np.linalg.norm(configured[3:])
        return pinocchio.aba(self.model, self.data, configured, state[7:], wrench).copy()


@pytest.mark.parametrize("name", POSTURES)
@pytest.mark.parametrize("seed", range(10))
def test_accelerations_agree(name, seed):
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
    expected = FreeBody(posture).acceleration(state, wrench)
    np.testing.assert_allclose(derivative[7:], expected, rtol=1e-8, atol=1e-8)


@pytest.mark.long
def test_trajectory_agrees():
    """One second from a tumbling start, 20 000 steps, against SciPy's DOP853 on Pinocchio's acceleration."""
    scenario = SCENARIOS["head_down"]
    posture, constants = oracle_posture(scenario, joint_angles(scenario)), oracle_constants(scenario)
    body = FreeBody(posture)
    control = np.array([1.0, 0.5, 1.5, 0.0])

    def derivative(_, state):
        wrench = np.concatenate(oracle.force_and_moment(state[7:10], state[10:], control, posture, constants))
        travelling = oracle.rotation_matrix(state[3:7]) @ state[7:10]
        turning = oracle.quaternion_derivative(state[3:7], state[10:])
        return np.concatenate([travelling, turning, body.acceleration(state, wrench)])

    start = np.array([0.0, 0.0, 0.0, 0.1, -0.2, 0.3, 0.0, 5.0, -3.0, -55.0, 0.5, -0.4, 2.0])
    start[6] = np.sqrt(1.0 - start[3:6] @ start[3:6])
    expected = solve_ivp(derivative, (0.0, 1.0), start, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    step = step_of(MODELS["head_down"]._replace(dt=5e-5))
    state = start.copy()
    for _ in range(20_000):
        step(state, control, state)
    np.testing.assert_allclose(state, expected, rtol=1e-8, atol=1e-8)
