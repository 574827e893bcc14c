"""The plant's kernels against the equations written out apart from them, and against conservation laws."""

import aerodynamics as oracle
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from skydiver_utc.body.movement import movement
from skydiver_utc.body.posture import configuration, pattern_direction, posture_angles
from skydiver_utc.body.segments import build_body
from skydiver_utc.parameters import load_scenario
from skydiver_utc.plant.dynamics import (
    WORK_SIZE,
    invert_inertia,
    limit_control,
    posture_geometry,
    rk4_step,
    state_derivative,
)
from skydiver_utc.plant.model import GEOMETRY_SIZE, INERTIA_AT, build_model, pack_geometry, posture_row

SCENARIO = load_scenario("fast_turn_unknown_dynamics")
BODY = build_body(SCENARIO.subject)
MODEL = build_model(SCENARIO)


def angles(alpha):
    return posture_angles(SCENARIO.posture) + alpha * pattern_direction(SCENARIO.pattern)


def oracle_posture(alpha):
    placed = configuration(BODY, angles(alpha))
    return oracle.Posture(placed.centre, placed.rotation, BODY.drag_area, BODY.total_mass, placed.inertia)


def oracle_constants():
    damping, hands = SCENARIO.plant.damping, SCENARIO.plant.hands
    return oracle.Constants(
        rho=SCENARIO.air.density_kg_m3,
        S=damping.reference_area_m2,
        L=damping.reference_length_m,
        Cm_roll=damping.Cm_damp_roll,
        Cm_pitch=damping.Cm_damp_pitch,
        K_N=hands.K_N,
        lx=hands.lx_m,
        g=9.80665,
    )


def random_state(rng):
    return np.concatenate(
        [
            rng.normal(0, 1000, 3),
            Rotation.random(random_state=int(rng.integers(1 << 30))).as_quat(),
            rng.normal(0, 40, 3),
            rng.normal(0, 4, 3),
        ]
    )


def random_control(rng):
    return MODEL.control_min + rng.random(4) * (MODEL.control_max - MODEL.control_min)


def exact_geometry(alpha):
    placed = configuration(BODY, angles(alpha))
    geometry, inverse = pack_geometry(BODY, placed, np.zeros(3)), np.empty(6)
    invert_inertia(geometry, inverse)
    return geometry, inverse


@pytest.mark.parametrize("seed", range(20))
def test_derivative_equals_transcription(seed):
    rng = np.random.default_rng(seed)
    state, control = random_state(rng), random_control(rng)
    geometry, inverse = exact_geometry(control[3])
    derivative = np.empty(13)
    state_derivative(MODEL, geometry, inverse, control, state, derivative)
    expected = oracle.state_derivative(state, control, oracle_posture(control[3]), oracle_constants())
    np.testing.assert_allclose(derivative, expected, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("seed", range(5))
def test_step_equals_transcription_with_tabulated_posture(seed):
    """The cubic posture table costs less than 1e-7 of a step."""
    rng = np.random.default_rng(100 + seed)
    state, control = random_state(rng), random_control(rng)
    following = np.empty(13)
    rk4_step(MODEL, state, control, following, np.empty(WORK_SIZE))
    posture, constants = oracle_posture(control[3]), oracle_constants()
    expected = oracle.rk4(
        lambda x: oracle.state_derivative(x, control, posture, constants, normalise=False), state, MODEL.dt
    )
    np.testing.assert_allclose(following - state, expected - state, rtol=1e-6, atol=1e-7)


def test_posture_table_error_bound():
    """Between its nodes the table keeps position, drag, inertia and swing entries to 2e-6 (m, m2, kg m2)."""
    row = np.empty(GEOMETRY_SIZE)
    moves = movement(SCENARIO.posture, SCENARIO.pattern)
    for alpha in np.linspace(*SCENARIO.plant.limits.alpha, 257):
        posture_geometry(MODEL, alpha, row)
        np.testing.assert_allclose(row, posture_row(BODY, moves, alpha), atol=2e-6)


def vacuum(model):
    return model._replace(half_density=0.0, gravity=0.0, hand_force=0.0)


def test_momentum_and_energy_are_kept_without_air_and_gravity():
    """A free rigid body: momentum, angular momentum in the world and kinetic energy stay to 1e-9 over 4 s."""
    model = vacuum(MODEL)._replace(dt=0.0002)
    rng = np.random.default_rng(3)
    state, control = random_state(rng), np.array([1.0, 0.0, 0.0, 0.8])
    posture = oracle_posture(0.8)
    geometry = np.empty(GEOMETRY_SIZE)
    posture_geometry(model, 0.8, geometry)
    xx, yy, zz, xy, xz, yz = geometry[INERTIA_AT : INERTIA_AT + 6]
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    def invariants(x):
        world = Rotation.from_quat(x[3:7]).as_matrix()
        spin = inertia @ x[10:13]
        energy = 0.5 * posture.m * x[7:10] @ x[7:10] + 0.5 * x[10:13] @ spin
        return np.concatenate([posture.m * world @ x[7:10], world @ spin, [energy]])

    before = invariants(state)
    work = np.empty(WORK_SIZE)
    for _ in range(20_000):
        rk4_step(model, state, control, state, work)
    np.testing.assert_allclose(invariants(state), before, rtol=1e-9)


def test_free_fall_in_vacuum_is_a_parabola():
    model = MODEL._replace(half_density=0.0, hand_force=0.0)
    state = np.zeros(13)
    state[6], state[7] = 1.0, 20.0
    work = np.empty(WORK_SIZE)
    for _ in range(1000):
        rk4_step(model, state, np.zeros(4), state, work)
    t = 1000 * model.dt
    np.testing.assert_allclose(state[:3], [20.0 * t, 0.0, -0.5 * 9.80665 * t * t], rtol=1e-12, atol=1e-9)


def test_integration_against_an_independent_integrator():
    """Two seconds of a held turn against SciPy's DOP853 on the transcription."""
    posture, constants = oracle_posture(0.7), oracle_constants()
    control = np.array([0.3, 0.5, 1.5, 0.7])
    start = np.zeros(13)
    start[6], start[9] = 1.0, -58.0
    solution = solve_ivp(
        lambda _, x: oracle.state_derivative(x, control, posture, constants),
        (0.0, 500 * MODEL.dt),
        start,
        method="DOP853",
        rtol=1e-11,
        atol=1e-11,
    )
    state, work = start.copy(), np.empty(WORK_SIZE)
    for _ in range(500):
        rk4_step(MODEL, state, control, state, work)
    np.testing.assert_allclose(state, solution.y[:, -1], rtol=2e-4, atol=2e-4)


def test_hands_push_as_in_eq_force2():
    """M_x = K_N lx (k_left - k_right), F_z = K_N (k_right + k_left), from the difference to hands at rest."""
    state, rest, pressed = np.zeros(13), np.empty(13), np.empty(13)
    state[6], state[9] = 1.0, -58.0
    geometry, inverse = exact_geometry(0.0)
    state_derivative(MODEL, geometry, inverse, np.array([1.0, 0.0, 0.0, 0.0]), state, rest)
    state_derivative(MODEL, geometry, inverse, np.array([1.0, 0.5, 2.0, 0.0]), state, pressed)
    difference = pressed - rest
    moment, force = oracle.hand_moment_and_force(
        0.5, 2.0, SCENARIO.plant.hands.K_N, SCENARIO.plant.hands.lx_m
    )
    np.testing.assert_allclose(difference[7:10], force / BODY.total_mass, atol=1e-12)
    inertia = configuration(BODY, angles(0.0)).inertia
    np.testing.assert_allclose(inertia @ difference[10:13], moment, atol=1e-10)


def test_limits_bound_then_slew():
    applied = np.empty(4)
    previous = np.array([0.5, 0.0, 0.0, 0.1])
    limit_control(MODEL, np.array([9.0, -1.0, 7.0, 1.0]), previous, applied)
    np.testing.assert_array_equal(applied[:3], [MODEL.control_max[0], 0.0, MODEL.control_max[2]])
    assert applied[3] == pytest.approx(0.1 + 3.5 * SCENARIO.dt_s, rel=1e-15)


def test_limits_may_write_over_the_previous_control():
    control = np.array([0.5, 0.0, 0.0, 0.1])
    limit_control(MODEL, np.array([0.5, 0.0, 0.0, 1.0]), control, control)
    assert control[3] == pytest.approx(0.1 + 3.5 * SCENARIO.dt_s, rel=1e-15)
