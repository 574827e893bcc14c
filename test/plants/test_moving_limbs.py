# SPDX-License-Identifier: Apache-2.0
"""Moving limbs: their air velocity and reaction against what is computed apart from the kernels, and their bounds."""

from copy import copy
from functools import cache

import aerodynamics as oracle
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from skydivers import (
    joint_angles,
    model_of,
    oracle_constants,
    oracle_posture,
    random_control,
    random_state,
)

from skydiver_utc.body.posture import configuration, pattern_direction, posture_angles
from skydiver_utc.body.segments import build_body
from skydiver_utc.parameters import load_scenario
from skydiver_utc.plants.skydiver.dynamics import posture_geometry, segment_drift
from skydiver_utc.plants.skydiver.model import GEOMETRY_SIZE, SEGMENT_COUNT
from skydiver_utc.plants.skydiver.skydiver import SkydiverPlant

ARMS = {
    "left_shoulder": [0.6, 0.3, 0.0],
    "right_shoulder": [-0.6, -0.3, 0.0],
    "left_elbow": [0.2, 0.0, 0.0],
}


@cache
def plant_of(dt=0.0042, nodes=1025, reaction=True):
    """Scenario and plant; the table is fine, so that the mechanics is tested and not the interpolation."""
    norm = np.sqrt(sum(np.square(row).sum() for row in ARMS.values()))
    components = {joint: [float(c / norm) for c in row] for joint, row in ARMS.items()}
    settings = {"plant.pattern.components": components, "plant.pattern_nodes": nodes, "dt_s": dt}
    scenario = load_scenario("bank_recovery", settings | {"plant.limbs.reaction": reaction})
    return scenario, SkydiverPlant(scenario.plant, dt)


def in_vacuum(plant):
    copied = copy(plant)
    empty = plant.constants._replace(half_density=0.0, gravity=0.0, hand_force=0.0)
    copied.model = plant.model._replace(parameters=empty)
    return copied


def total_angular_momentum(scenario, state, alpha, rate):
    """About the centre of mass, in the world: spin and orbit of every segment, velocities by Richardson's rule."""
    body = build_body(scenario.plant.subject)
    neutral, direction = posture_angles(scenario.plant.posture), pattern_direction(scenario.plant.pattern)
    here = configuration(body, neutral + alpha * direction)

    def difference(step):
        before, after = (configuration(body, neutral + (alpha + s * step) * direction) for s in (-1, 1))
        return (after.centre - before.centre) / (2 * step), (after.rotation - before.rotation) / (2 * step)

    (centre_1, rotation_1), (centre_2, rotation_2) = difference(2e-3), difference(1e-3)
    velocity = (4 * centre_2 - centre_1) / 3 * rate
    turning = (4 * rotation_2 - rotation_1) / 3 * rate
    total = np.zeros(3)
    for i in range(16):
        R = here.rotation[i]
        spin = turning[i] @ R.T
        omega = state[10:13] + np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
        total += R @ (body.inertia[i] * (R.T @ omega))
        moving = velocity[i] + np.cross(state[10:13], here.centre[i])
        total += body.mass[i] * np.cross(here.centre[i], moving)
    return Rotation.from_quat(state[3:7]).apply(total)


@pytest.mark.parametrize("spin", [0.0, 3.0])
@pytest.mark.parametrize(
    ("dt", "nodes", "bound"), [(0.001, 1025, 1e-9), (0.0042, 65, 5e-7)], ids=["fine", "as flown"]
)
def test_angular_momentum_is_kept_in_vacuum(spin, dt, nodes, bound):
    """Arms swung out and back for 1.5 s: the body turns, the total [kg m2/s] stays as docs/model.md says."""
    scenario, plant = plant_of(dt, nodes)
    plant = in_vacuum(plant)
    state, held = plant.initial_state(), plant.initial_applied()
    state[3:7], state[7:10] = [0.0, 0.0, 0.0, 1.0], [0.0, 0.0, -50.0]
    state[10:13] = [0.1 * spin, -0.2 * spin, spin]
    start = total_angular_momentum(scenario, state, 0.0, 0.0)
    largest_turn = 0.0
    for k in range(round(1.5 / dt)):
        target = 1.2 if k * dt < 0.7 else -0.3
        before, held = held, plant.actuate(np.array([0.5, 0.0, 0.0, target]), held)
        state = plant.step(state, before, held)
        if k % 50 == 0:
            now = total_angular_momentum(scenario, state, held[3], held[4])
            np.testing.assert_allclose(now, start, atol=bound)
        largest_turn = max(largest_turn, 2 * np.linalg.norm(state[3:6]))
    if spin == 0.0:
        assert largest_turn > np.deg2rad(2)


def test_limbs_change_their_rate_as_fast_as_they_can_still_brake():
    """Where neither rate nor acceleration is the largest: r^2 = 2 a d at a distance d, or half of it is left."""
    _, plant = plant_of()
    rng, dt, most = np.random.default_rng(2), plant.dt_s, 100.0
    kinds = {"rate": 0, "acceleration": 0, "braking": 0, "half": 0}
    for distance in 10.0 ** rng.uniform(-6.0, 0.0, 2000):
        start = rng.uniform(-1.0, 1.0) * min(3.5, np.sqrt(2.0 * most * distance))
        target = rng.choice([-1.0, 1.0]) * distance
        _, _, _, reached, rate = plant.actuate(np.array([0.5, 0.0, 0.0, target]), np.r_[np.zeros(4), start])
        assert reached == pytest.approx(0.5 * dt * (start + rate), abs=1e-15)
        assert max(abs(rate) / 3.5, abs(rate - start) / (most * dt)) <= 1.0 + 1e-12
        found = {
            "rate": abs(abs(rate) - 3.5) < 1e-9,
            "acceleration": abs(abs(rate - start) - most * dt) < 1e-9,
            "braking": abs(rate**2 - 2.0 * most * abs(target - reached)) < 1e-9,
            "half": abs(rate * dt - 2.0 * (target - reached)) < 1e-12,
        }
        assert any(found.values())
        for kind in found:
            kinds[kind] += found[kind]
    assert min(kinds.values()) > 10


@pytest.mark.parametrize("rate", [-3.5, 0.7])
def test_segments_move_with_the_table(rate):
    """The velocities are the slope of the tabulated places times the rate, in the first and last cells, too."""
    model = model_of(plant_of(nodes=65)[0])
    step, drift = 1e-3 / model.nodes_per_rad, np.full(3 * SEGMENT_COUNT + 1, np.nan)
    before, after = np.empty(GEOMETRY_SIZE), np.empty(GEOMETRY_SIZE)
    for cell in range(64):
        alpha = model.alpha_first + (cell + 0.3) / model.nodes_per_rad
        posture_geometry(model, alpha - step, before)
        posture_geometry(model, alpha + step, after)
        segment_drift(model, alpha, rate, drift)
        slope = (after - before)[: 3 * SEGMENT_COUNT] / (2 * step)
        np.testing.assert_allclose(drift[:-1], rate * slope, atol=1e-7)
        assert np.abs(drift[:-1]).max() > 0.1 * abs(rate)
        assert np.isnan(drift[-1])


def limb_motion(scenario, alpha, rate, acceleration):
    """The oracle's motion while alpha's rate changes evenly; velocities by differences."""

    def at(time):
        now, rate_now = alpha + rate * time + 0.5 * acceleration * time**2, rate + acceleration * time
        here, before, after = (
            oracle_posture(scenario, joint_angles(scenario, now + step)) for step in (0.0, -1e-4, 1e-4)
        )
        h = total_angular_momentum(scenario, np.eye(13)[6], now, rate_now)
        return oracle.Motion(here, rate_now * (after.r - before.r) / 2e-4, h)

    return at


@pytest.mark.parametrize("seed", range(6))
def test_a_step_of_moving_limbs_equals_the_transcription(seed):
    scenario, plant = plant_of()
    rng, dt = np.random.default_rng(seed), plant.dt_s
    state, control = random_state(rng), random_control(rng, scenario)
    alpha, rate, rate_after = rng.uniform(-1.2, 1.2), rng.uniform(-3.5, 3.5), rng.uniform(-3.5, 3.5)
    motion = limb_motion(scenario, alpha, rate, (rate_after - rate) / dt)
    expected = oracle.moving_step(state, control, motion, oracle_constants(scenario), dt)
    before = np.array([0.0, 0.0, 0.0, alpha, rate])
    applied = np.array([*control[:3], alpha + 0.5 * dt * (rate + rate_after), rate_after])
    found = plant.step(state, before, applied)
    np.testing.assert_allclose(found - state, expected - state, rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_limbs_that_move_too_fast_to_brake_stop_at_their_bound(side):
    """Never beyond, and the rates are those of an even change over each step."""
    _, plant = plant_of()
    bound = plant.maximum[3] if side > 0 else plant.minimum[3]
    before = np.array([0.5, 0.0, 0.0, bound - side * 0.001, side * 3.5])
    path = []
    for _ in range(100):
        held = plant.actuate(np.array([0.5, 0.0, 0.0, side * 9.0]), before)
        assert held[3] - before[3] == pytest.approx(0.5 * plant.dt_s * (before[4] + held[4]), abs=1e-15)
        path.append(held[3])
        before = held
    assert path[0] == bound
    assert plant.minimum[3] <= min(path)
    assert max(path) <= plant.maximum[3]
    assert held[3:5] == pytest.approx([bound, 0.0], abs=1e-3)
