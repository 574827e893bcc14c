"""The equations of motion against Pinocchio's free body, with force and moment from the oracle."""

import aerodynamics as oracle
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from skydiver_utc.body.posture import configuration, pattern_direction, posture_angles
from skydiver_utc.body.segments import build_body
from skydiver_utc.parameters import load_scenario
from skydiver_utc.plant.dynamics import WORK_SIZE, invert_inertia, rk4_step, state_derivative
from skydiver_utc.plant.model import build_model, pack_geometry

pinocchio = pytest.importorskip("pinocchio", reason="needs the wheel `pin`")

POSTURES = ("neutral", "back_to_earth", "head_down")


def skydiver(name, alpha):
    """Scenario, oracle's posture and constants, geometry and inverse inertia of a library posture."""
    scenario = load_scenario("fast_turn_unknown_dynamics", {"posture": name})
    body = build_body(scenario.subject)
    angles = posture_angles(scenario.posture) + alpha * pattern_direction(scenario.pattern)
    placed = configuration(body, angles)
    posture = oracle.Posture(placed.centre, placed.rotation, body.drag_area, body.total_mass, placed.inertia)
    damping, hands = scenario.plant.damping, scenario.plant.hands
    constants = oracle.Constants(
        rho=scenario.air.density_kg_m3,
        S=damping.reference_area_m2,
        L=damping.reference_length_m,
        Cm_roll=damping.Cm_damp_roll,
        Cm_pitch=damping.Cm_damp_pitch,
        K_N=hands.K_N,
        lx=hands.lx_m,
        g=9.80665,
    )
    geometry, inverse = pack_geometry(body, placed, np.zeros(3)), np.empty(6)
    invert_inertia(geometry, inverse)
    return scenario, posture, constants, geometry, inverse


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


def random_state(rng):
    attitude = Rotation.random(random_state=int(rng.integers(1 << 30))).as_quat()
    return np.concatenate([rng.normal(0, 1000, 3), attitude, rng.normal(0, 40, 3), rng.normal(0, 4, 3)])


@pytest.mark.parametrize("name", POSTURES)
@pytest.mark.parametrize("seed", range(10))
def test_accelerations_agree(name, seed):
    rng = np.random.default_rng(seed)
    alpha = rng.uniform(-1.5, 1.5)
    scenario, posture, constants, geometry, inverse = skydiver(name, alpha)
    limits = scenario.plant.limits
    control = np.array(limits.minimum) + rng.random(4) * (np.array(limits.maximum) - np.array(limits.minimum))
    control[3] = alpha
    state, derivative = random_state(rng), np.empty(13)
    state_derivative(build_model(scenario), geometry, inverse, control, state, derivative)
    wrench = np.concatenate(oracle.force_and_moment(state[7:10], state[10:], control, posture, constants))
    expected = FreeBody(posture).acceleration(state, wrench)
    np.testing.assert_allclose(derivative[7:], expected, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("name", POSTURES)
def test_trajectory_agrees(name):
    """One second from a tumbling start, 20 000 steps, against SciPy's DOP853 on Pinocchio's acceleration."""
    scenario, posture, constants, _, _ = skydiver(name, 0.0)
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
    model = build_model(scenario)._replace(dt=5e-5)
    state, work = start.copy(), np.empty(WORK_SIZE)
    for _ in range(20_000):
        rk4_step(model, state, control, state, work)
    np.testing.assert_allclose(state, expected, rtol=1e-8, atol=1e-8)
