# SPDX-License-Identifier: Apache-2.0
"""The plant's kernels against the equations written out apart from them, and against Pinocchio's free body."""

import aerodynamics as oracle
import numpy as np
import pytest
from skydivers import (
    joint_angles,
    model_of,
    oracle_constants,
    oracle_derivative,
    oracle_posture,
    plant_of,
    random_control,
    random_state,
    skydiver,
    step_of,
)

from skydiver_utc.body.movement import movement
from skydiver_utc.body.posture import configuration
from skydiver_utc.body.segments import build_body
from skydiver_utc.plants.skydiver.dynamics import (
    invert_inertia,
    posture_geometry,
    state_derivative,
)
from skydiver_utc.plants.skydiver.model import GEOMETRY_SIZE, held_row, posture_rows

SCENARIO = skydiver("fast_turn_unknown_dynamics")
BODY = build_body(SCENARIO.plant.subject)
MODEL = model_of(SCENARIO)
# By the direction of the hands' force.
PULLED = {name: skydiver("fast_turn_unknown_dynamics", hands__force=name) for name in ("ventral", "dorsal")}
MODELS = {name: model_of(scenario) for name, scenario in PULLED.items()}


def exact_geometry(alpha):
    geometry, inverse = held_row(BODY, joint_angles(SCENARIO, alpha)), np.empty(6)
    invert_inertia(geometry, inverse)
    return geometry, inverse


@pytest.mark.parametrize("direction", PULLED)
@pytest.mark.parametrize("seed", range(20))
def test_derivative_equals_transcription(seed, direction):
    rng, scenario = np.random.default_rng(seed), PULLED[direction]
    state, control = random_state(rng), random_control(rng, scenario)
    geometry, inverse = exact_geometry(control[3])
    derivative = np.empty(13)
    state_derivative(MODELS[direction], geometry, inverse, control, state, derivative)
    expected = oracle_derivative(scenario, control)(state)
    np.testing.assert_allclose(derivative, expected, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("seed", range(10))
def test_the_transcription_accelerates_as_pinocchio_s_free_body(seed):
    """Velocity, wrench and acceleration in body axes, linear before angular."""
    pinocchio = pytest.importorskip("pinocchio", reason="needs the wheel `pin`")
    rng = np.random.default_rng(seed)
    state, control = random_state(rng), random_control(rng, SCENARIO)
    posture, constants = (
        oracle_posture(SCENARIO, joint_angles(SCENARIO, control[3])),
        oracle_constants(SCENARIO),
    )
    wrench = np.concatenate(oracle.force_and_moment(state[7:10], state[10:], control, posture, constants))
    body = pinocchio.Model()
    body.gravity.linear = np.array([0.0, 0.0, -9.80665])
    joint = body.addJoint(0, pinocchio.JointModelFreeFlyer(), pinocchio.SE3.Identity(), "body")
    inertia = pinocchio.Inertia(posture.m, np.zeros(3), posture.inertia)
    body.appendBodyToJoint(joint, inertia, pinocchio.SE3.Identity())
    expected = pinocchio.aba(body, body.createData(), state[:7], state[7:], wrench)
    found = oracle_derivative(SCENARIO, control)(state)[7:]
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("seed", range(5))
def test_step_equals_transcription_with_tabulated_posture(seed):
    """The cubic posture table costs less than 1e-7 of a step; a quaternion of another length has 1 after it."""
    rng = np.random.default_rng(100 + seed)
    state, control = random_state(rng), random_control(rng, SCENARIO)
    state[3:7] *= 1.0 + 0.1 * seed
    following = np.empty(13)
    step_of(MODEL)(state, control, following)
    posture = oracle_posture(SCENARIO, joint_angles(SCENARIO, control[3]))
    constants = oracle_constants(SCENARIO)
    expected = oracle.rk4(
        lambda x: oracle.state_derivative(x, control, posture, constants, normalise=False), state, MODEL.dt
    )
    np.testing.assert_allclose(following - state, expected - state, rtol=1e-6, atol=1e-7)


def test_a_posture_that_stays_is_read_from_the_table_once():
    """Of steps at one pattern angle the second needs no table."""
    kept = MODEL._replace(geometry=MODEL.geometry.copy(), work=np.full_like(MODEL.work, np.nan))
    rng = np.random.default_rng(7)
    state, control, found, expected = random_state(rng), random_control(rng, SCENARIO), *np.empty((2, 13))
    step_of(kept)(state, control, found)
    kept.geometry[:] = np.nan
    step_of(kept)(found, control, found)
    step_of(MODEL)(state, control, expected)
    step_of(MODEL)(expected, control, expected)
    np.testing.assert_array_equal(found, expected)


def test_posture_table_error_bound():
    """Between its nodes the table keeps position, drag, inertia and swing entries to 2e-6 (m, m2, kg m2)."""
    row, alphas = np.empty(GEOMETRY_SIZE), np.linspace(*SCENARIO.plant.limits.alpha, 257)
    exact = posture_rows(BODY, movement(SCENARIO.plant.posture, SCENARIO.plant.pattern), alphas)
    for alpha, expected in zip(alphas, exact, strict=True):
        posture_geometry(MODEL, alpha, row)
        np.testing.assert_allclose(row, expected, atol=2e-6)


@pytest.mark.parametrize(("direction", "along_z"), [("ventral", -1.0), ("dorsal", 1.0)])
def test_a_hand_pulls_at_its_place(direction, along_z):
    """From the difference to hands at rest: a force along z at y = -lx (right) and lx (left), and r x F."""
    state, rest, pressed = np.zeros(13), np.empty(13), np.empty(13)
    state[6], state[9] = 1.0, -58.0
    geometry, inverse = exact_geometry(0.0)
    model, hands = MODELS[direction], SCENARIO.plant.hands
    state_derivative(model, geometry, inverse, np.array([1.0, 0.0, 0.0, 0.0]), state, rest)
    state_derivative(model, geometry, inverse, np.array([1.0, 0.5, 2.0, 0.0]), state, pressed)
    difference = pressed - rest
    right, left = (np.array([0.0, 0.0, along_z * k * hands.K_N]) for k in (0.5, 2.0))
    force = right + left
    moment = np.cross([0.0, -hands.lx_m, 0.0], right) + np.cross([0.0, hands.lx_m, 0.0], left)
    np.testing.assert_allclose(difference[7:10], force / BODY.total_mass, atol=1e-12)
    inertia = configuration(BODY, joint_angles(SCENARIO)).inertia
    np.testing.assert_allclose(inertia @ difference[10:13], moment, atol=1e-10)


def test_limits_bound_then_slew():
    plant = plant_of("fast_turn_unknown_dynamics", limbs__reaction=False)
    before, slew = np.array([0.5, 0.0, 0.0, 0.1, 0.0]), 3.5 * SCENARIO.dt_s
    for alpha, reached in ((1.0, 0.1 + slew), (-1.0, 0.1 - slew), (0.1 + 0.5 * slew, 0.1 + 0.5 * slew)):
        applied = plant.actuate(np.array([9.0, -1.0, 7.0, alpha]), before)
        np.testing.assert_array_equal(applied[:3], [plant.maximum[0], 0.0, plant.maximum[2]])
        assert applied[3:].tolist() == [pytest.approx(reached, rel=1e-15), 0.0]
