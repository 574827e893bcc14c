# SPDX-License-Identifier: Apache-2.0
"""Straight falls, their modes and steady turns, against the oracle's flight and what can be worked out by hand."""

from functools import cache

import numpy as np
import pytest
from refusals import assert_refused
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.spatial.transform import Rotation
from skydivers import model_of, oracle_derivative, plant_of, skydiver

from skydiver_utc.body.posture import posture_angles
from skydiver_utc.body.segments import build_body
from skydiver_utc.parameters import ParameterError
from skydiver_utc.plants.skydiver.fall_report import fall_report
from skydiver_utc.plants.skydiver.linearise import control_effect, linearise, tilt_axes, velocity_axes
from skydiver_utc.plants.skydiver.model import GEOMETRY_SIZE, INERTIA_AT
from skydiver_utc.plants.skydiver.modes import Mode, modes
from skydiver_utc.plants.skydiver.pattern_report import pattern_effect
from skydiver_utc.plants.skydiver.reduced import belly_to_earth
from skydiver_utc.plants.skydiver.skydiver import SkydiverPlant
from skydiver_utc.plants.skydiver.steady import (
    HeldBody,
    SteadyFall,
    falling_straight,
    steady_turn,
    straight_falls,
)
from skydiver_utc.plants.skydiver.table_error import TableError
from skydiver_utc.plants.skydiver.trim import in_posture, straight_fall

POSTURES = ("neutral", "back_to_earth", "head_down", "track")
REST = np.array([0.5, 0.0, 0.0, 0.0])


@cache
def scenario_of(name):
    return skydiver(posture=name)


@cache
def held(name):
    """Model and straight falls of a posture."""
    model = model_of(scenario_of(name))
    return model, straight_falls(model)


def state_of(up, velocity, rates):
    """A state (13,) with the world's up direction `up` in body axes; SciPy finds the attitude."""
    attitude, _ = Rotation.align_vectors([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]], [up, tilt_axes(up)[0]])
    return np.concatenate([np.zeros(3), attitude.as_quat(), velocity, rates])


@pytest.mark.parametrize("name", POSTURES)
def test_the_oracle_finds_no_acceleration_either(name):
    derivative = oracle_derivative(scenario_of(name), REST)
    _, falls = held(name)
    assert len(falls) == 2
    for fall in falls:
        state = state_of(fall.up, fall.velocity, fall.rates)
        assert np.abs(derivative(state)[7:]).max() < 1e-6
        assert -derivative(state)[2] == pytest.approx(fall.fall_rate)


@pytest.mark.parametrize("name", POSTURES)
def test_a_small_deviation_flies_as_the_system_matrix_says(name):
    """The oracle's flight over 0.3 s from a small deviation in all eight states, against the matrix exponential."""
    model, (fall, _) = held(name)
    matrix = linearise(HeldBody(model, REST), fall)
    assert abs(matrix[3, 6]) * fall.speed == pytest.approx(abs(fall.pitch_stiffness), rel=1e-4)
    deviation = 1e-5 * np.array([1.0, -1.0, 1.0, 1.0, -1.0, 10.0, -10.0, 10.0])
    tilts, speeds = tilt_axes(fall.up), velocity_axes(fall)
    start = state_of(fall.up, fall.velocity + deviation[5:] @ speeds, deviation[2:5])
    tilted = Rotation.from_quat(start[3:7]) * Rotation.from_rotvec(deviation[:2] @ tilts)
    start[3:7] = tilted.as_quat()
    derivative = oracle_derivative(scenario_of(name), REST)
    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
    end = solve_ivp(lambda _, x: derivative(x), (0.0, 0.3), start, **options).y[:, -1]
    up = Rotation.from_quat(end[3:7]).inv().apply([0.0, 0.0, 1.0])
    flown = np.concatenate([tilts @ np.cross(up, fall.up), end[10:], speeds @ (end[7:10] - fall.velocity)])
    expected = expm(0.3 * matrix) @ deviation
    np.testing.assert_allclose(flown, expected, atol=2e-3 * np.abs(expected).max())
    np.testing.assert_allclose(flown[:2], expected[:2], atol=1e-8)


def ball():
    """A ball: one drag area in all directions at the centre of mass, another moment of inertia about each axis."""
    model, _ = held("neutral")
    geometry = np.zeros(GEOMETRY_SIZE)
    geometry[3 * 16 : 6 * 16] = 0.5 / 16
    geometry[INERTIA_AT : INERTIA_AT + 3] = 4.0, 12.0, 14.0
    return model._replace(geometry=np.tile(geometry, (65, 1)))


@pytest.mark.parametrize("name", POSTURES)
def test_the_effect_of_the_controls_is_the_oracles(name):
    model, (fall, _) = held(name)
    state, step = state_of(fall.up, fall.velocity, fall.rates), 1e-4
    for d, effect in zip(step * np.eye(4), control_effect(model, REST, fall).T, strict=True):
        after, before = (oracle_derivative(scenario_of(name), REST + sign * d)(state)[7:] for sign in (1, -1))
        change = (after - before) / (2.0 * step)
        expected = np.concatenate([np.zeros(2), change[3:], velocity_axes(fall) @ change[:3]])
        np.testing.assert_allclose(effect, expected, rtol=1e-5, atol=1e-4)  # postures from a table


def test_the_reduced_states_of_a_fall_are_its_tilt_rates_and_velocity():
    """From any state and back, but for place and heading; of the straight fall belly to earth nothing accelerates."""
    at_rest, reduce, expand = plant_of(posture="back_to_earth").reduced(REST)
    derivative = oracle_derivative(scenario_of("back_to_earth"), np.zeros(4))(expand(at_rest))
    assert np.abs(derivative[7:]).max() < 1e-6
    assert Rotation.from_quat(expand(at_rest)[3:7]).apply([0.0, 0.0, 1.0])[2] > 0.0
    z = np.array([0.2, -0.3, 1.0, 2.0, 3.0, 4.0, 5.0, -6.0])
    np.testing.assert_allclose(reduce(expand(z)), z, atol=1e-12)
    np.testing.assert_array_equal(expand(z)[:3], np.zeros(3))
    assert np.linalg.norm(expand(z)[3:7]) == pytest.approx(1.0, rel=1e-12)
    for heading in (0.0, 1.1):
        attitude = Rotation.from_euler("zyx", [heading, -0.4, 0.3])
        expected = [*attitude.inv().apply([0.0, 0.0, 1.0])[:2], *z[2:]]
        state = np.concatenate([np.full(3, heading), attitude.as_quat(), z[5:], z[2:5]])
        np.testing.assert_allclose(reduce(state), expected, atol=1e-14)


def test_the_initial_state_is_that_of_the_settings():
    angles = {"initial__heading_deg": 30.0, "initial__pitch_deg": 20.0, "initial__bank_deg": -10.0}
    rates = {f"initial__{axis}_rate_deg_s": 10.0 * i for i, axis in enumerate(("roll", "pitch", "yaw"), 1)}
    plant = plant_of(initial__altitude_m=1234.0, initial__fall_speed_m_s=60.0, **angles, **rates)
    state, attitude = plant.initial_state(), Rotation.from_euler("ZYX", list(angles.values()), degrees=True)
    np.testing.assert_array_equal(state[:3], [0.0, 0.0, 1234.0])
    np.testing.assert_allclose(Rotation.from_quat(state[3:7]).as_matrix(), attitude.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(attitude.apply(state[7:10]), [0.0, 0.0, -60.0], atol=1e-9)
    np.testing.assert_allclose(state[10:], np.deg2rad([10.0, 20.0, 30.0]))


@pytest.mark.parametrize(
    ("places", "largest"), [((7, 8, 9), 500.0), ((10, 11, 12), 200.0), ((0, 1, 2), np.inf)]
)
def test_a_state_that_no_body_falls_with_is_a_fault(places, largest):
    plant, upright = plant_of(), np.eye(13)[6]
    for place in places:
        for size, wrong in ((0.99, largest == np.inf), (1.0, True), (-1.0, True), (np.nan, True)):
            state = upright.copy()
            state[place] = size * largest
            assert bool(plant.fault(state)) is wrong
    state[7:13] = 300.0, 0.0, 400.0, 120.0, 0.0, 160.0
    assert "speed 500 m/s, body rate 200 rad/s" in plant.fault(state)


def test_a_step_that_a_class_of_the_skydiver_writes_anew_counts():
    class Own(SkydiverPlant):
        def step(self, state, before, applied):
            return state + 1.0

    plant = Own(scenario_of("neutral").plant, 0.0042)
    state, _ = plant.advance(plant.initial_state(), plant.initial_applied(), plant.initial_control())
    np.testing.assert_array_equal(state, plant.initial_state() + 1.0)


@pytest.mark.parametrize("belly_to_earth", [True, False])
def test_a_dorsal_axis_below_the_horizon_is_a_mishap_where_the_settings_say_so(belly_to_earth):
    plant = plant_of(belly_to_earth=belly_to_earth)
    turned = [Rotation.from_euler("x", angle, degrees=True).as_quat() for angle in (0.0, 89.9, 90.1, 180.0)]
    for attitude, below in zip([*turned, 4 * [0.5]], (False, False, True, True, False), strict=True):
        state = np.zeros(13)
        state[3:7] = attitude
        assert not plant.fault(state)
        assert bool(plant.mishap(state)) == (below and belly_to_earth)


@pytest.mark.parametrize(
    ("eigenvalue", "stable", "time_constant", "frequency", "damping_ratio"),
    [
        (-3 + 4j, True, 1 / 3, 5 / (2 * np.pi), 0.6),
        (3 + 4j, False, 1 / 3, 5 / (2 * np.pi), -0.6),
        (0.2 + 0.1j, False, 5.0, np.hypot(0.2, 0.1) / (2 * np.pi), -0.2 / np.hypot(0.2, 0.1)),
        (-0.5, True, 2.0, None, None),
        (0.5, False, 2.0, None, None),
        (0.0, False, None, None, None),
    ],
)
def test_numbers_of_a_mode(eigenvalue, stable, time_constant, frequency, damping_ratio):
    found = Mode("any", complex(eigenvalue), {}).as_dict()
    assert found["stable"] is stable
    numbers = found["time_constant_s"], found["frequency_hz"], found["damping_ratio"]
    assert numbers == pytest.approx((time_constant, frequency, damping_ratio))


def test_modes_that_share_no_states_have_their_names_in_order():
    """Of a diagonal matrix each state is a mode; tilts belong to the axes about which they turn."""
    (fall, _) = held("neutral")[1]
    level = SteadyFall(np.array([0.0, 0.0, 1.0]), fall.velocity, fall.rates, fall.residual)
    found = modes(np.diag([-1.0, 2.0, -3.0, 4.0, -5.0, 6.0, 0.0, -8.0]), level)
    assert [mode.name for mode in found] == [
        *("slide subsidence", "fall rate divergence", "yaw subsidence", "pitch divergence 1"),
        *("roll subsidence 1", "pitch divergence 2", "roll subsidence 2", "glide divergence"),
    ]


@pytest.mark.parametrize(
    "up", [*Rotation.random(4, random_state=1).as_matrix()[:, 2], np.array([0.0, -1.0, 0.0])]
)
def test_the_axes_of_tilts_and_the_up_direction_are_a_frame(up):
    side, pitch = tilt_axes(up)
    np.testing.assert_allclose(np.array([side, pitch, up]).T @ [side, pitch, up], np.eye(3), atol=1e-12)
    np.testing.assert_allclose(np.cross(side, pitch), up, atol=1e-12)
    nearest = 1 if abs(up[1]) < 0.9 else 2
    assert pitch[nearest] == pytest.approx(np.sqrt(1.0 - up[nearest] ** 2))


@pytest.mark.parametrize(("pitch_deg", "name"), [(44.0, "roll"), (46.0, "yaw")])
def test_a_tilt_to_the_side_belongs_to_the_body_axis_nearest_to_its_own(pitch_deg, name):
    """That is cos(pitch) along x and sin(pitch) along z."""
    fall = falling_straight(50.0, np.deg2rad(pitch_deg))
    assert modes(np.diag([-9.0, *range(-8, -1)]), fall)[0].name == f"{name} subsidence 1"
    assert (fall.fall_rate, np.rad2deg(fall.pitch)) == pytest.approx((50.0, pitch_deg))
    np.testing.assert_allclose(fall.velocity, -50.0 * fall.up, atol=1e-12)
    assert (fall.rates.tolist(), fall.residual.tolist()) == ([0.0] * 3, [0.0] * 6)


ROUNDED = np.nextafter(1.0, 2.0)


@pytest.mark.parametrize(
    ("up", "facing", "pitch", "bank"),
    [
        ([0.0, 0.0, 1.0], "belly to earth", 0.0, 0.0),
        ([0.0, 0.0, -1.0], "back to earth", 0.0, 0.0),
        ([-ROUNDED, 0.0, 0.0], "head down", 90.0, 0.0),
        ([ROUNDED, 0.0, 0.0], "feet down", -90.0, 0.0),
        ([0.0, ROUNDED, 0.0], "right side down", 0.0, 90.0),
        ([0.0, -ROUNDED, 0.0], "left side down", 0.0, -90.0),
        ([-0.5, 0.0, np.sqrt(0.75)], "belly to earth", 30.0, 0.0),
    ],
)
def test_words_and_angles_of_a_fall(up, facing, pitch, bank):
    """Down at 40 m/s, and along one axis after the other across it at 30."""
    up, words = np.array(up), {0: "headwards feetwards", 1: "left right", 2: "dorsal ventral"}
    for axis in np.flatnonzero(np.abs(up) < 1e-9):
        for sign, word in zip((1.0, -1.0), words[axis].split(), strict=True):
            velocity = -40.0 * up + sign * 30.0 * np.eye(3)[axis]
            fall = SteadyFall(up, velocity, np.array([1.0, 2.0, 3.0]), np.zeros(6))
            assert (fall.facing, fall.glide_direction) == (facing, word)
            found = fall.speed, fall.fall_rate, np.tan(fall.glide_angle), fall.yaw_rate
            assert found == pytest.approx((50.0, 40.0, 0.75, 3.0))
            assert np.rad2deg([fall.pitch, fall.bank]) == pytest.approx([pitch, bank])


BENT = skydiver().plant.posture.joint_angles_deg["left_shoulder"] + np.array([0.01, 0.0, 0.0])


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"pattern": "layout"}, "pattern layout is a path"),
        ({"limits__alpha": [0.5, 1.5], "initial__alpha": 0.5}, "from 0.5 to 1.5 leaves out 0"),
        ({"limits__alpha": [-1.5, -0.5], "initial__alpha": -0.5}, "from -1.5 to -0.5 leaves out 0"),
        ({"posture__joint_angles_deg__left_knee": [170.0, 0.0, 0.0]}, "left_knee flexion"),
        ({"posture__joint_angles_deg__left_shoulder": BENT.tolist()}, ["posture neutral", "left and right"]),
    ],
)
def test_a_posture_without_a_report_is_named(settings, words):
    assert_refused(words, fall_report, skydiver(**settings))


def test_the_effect_of_a_pattern_is_the_difference_half_a_radian_to_both_sides():
    scenario = skydiver(initial__pitch_deg=5.0)
    posture, direction = posture_angles(scenario.plant.posture), np.zeros((15, 3))
    direction[3, 1], direction[6, 0] = 0.6, 0.8
    body, model, initial = build_body(scenario.plant.subject), model_of(scenario), scenario.plant.initial
    more, less = (
        in_posture(body, model, posture + alpha * direction).straight_down(
            initial.fall_speed_m_s, np.deg2rad(5.0)
        )
        for alpha in (0.5, -0.5)
    )
    np.testing.assert_allclose(pattern_effect(scenario, posture, direction), more - less, rtol=1e-12)


def test_a_table_is_too_coarse_beyond_half_a_millimetre_or_5_g_m2():
    for place, inertia, too_large in ((5e-4, 5e-3, False), (5.1e-4, 0.0, True), (0.0, 5.1e-3, True)):
        error = TableError(place, inertia, 9.0)
        assert error.too_large is too_large
    assert {"0.5", "0.25"} <= set(str(TableError(5e-4, 0.25, 0.125)).split())


def test_a_fall_that_there_is_not_is_refused():
    with pytest.raises(ParameterError, match="no straight fall"):
        straight_falls(ball())
    with pytest.raises(ParameterError, match="belly to earth"):
        belly_to_earth(held("head_down")[0])
    scenario = scenario_of("head_down")
    with pytest.raises(ParameterError, match=r"pitch of -30\.0"):
        straight_fall(scenario, scenario.plant.posture, -30.0)


@pytest.mark.parametrize(("alpha", "damping"), [(0.5, 0.5), (1.5, 0.5), (1.0, 4.0)])
def test_a_steady_turn_turns_steadily_in_the_oracle(alpha, damping):
    model, (near, _) = held("neutral")
    for step in np.linspace(0.0, alpha, 7)[1:]:
        control = np.array([damping, 0.0, 0.0, step])
        near = steady_turn(HeldBody(model, control), near)
    state = state_of(near.up, near.velocity, near.rates)
    # The flight's posture table keeps every entry to 2e-6 only.
    assert np.abs(oracle_derivative(scenario_of("neutral"), control)(state)[7:]).max() < 1e-3
    np.testing.assert_allclose(np.cross(near.rates, near.up), 0.0, atol=1e-12)
    assert near.yaw_rate > 0
