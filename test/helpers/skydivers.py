# SPDX-License-Identifier: Apache-2.0
"""A scenario's skydiver as the oracle takes it, and random states of its flight."""

import aerodynamics as oracle
import numpy as np
from scipy.spatial.transform import Rotation

from skydiver_utc.body.posture import configuration, pattern_direction, posture_angles
from skydiver_utc.body.segments import build_body
from skydiver_utc.loop.build import build_controller, build_plant, build_reference
from skydiver_utc.parameters import load_scenario
from skydiver_utc.plants.protocol import Model
from skydiver_utc.plants.skydiver.dynamics import STATE_SIZE
from skydiver_utc.plants.skydiver.model import build_model
from skydiver_utc.plants.skydiver.prediction import named_outputs, skydiver_step


def skydiver(name="bank_recovery", **plant):
    """A scenario with these settings of the plant; `subject__suit="rig"` is plant.subject.suit."""
    return load_scenario(name, {f"plant.{key.replace('__', '.')}": value for key, value in plant.items()})


def plant_of(name="bank_recovery", **plant):
    """The plant of a scenario with these settings."""
    return build_plant(skydiver(name, **plant))


def parts_of(scenario):
    """Plant, reference and controller of a scenario."""
    plant, reference = build_plant(scenario), build_reference(scenario)
    return plant, reference, build_controller(scenario, plant, reference)


def model_of(scenario):
    return build_model(scenario.plant, scenario.dt_s)


def step_of(model):
    """A step (state, control (4,), out) of the skydiver with these numbers, by the program that the plant flies."""
    return Model(skydiver_step, named_outputs, model, STATE_SIZE).bound(4, 4).step


def joint_angles(scenario, alpha=0.0):
    """Joint angles (15, 3) [rad] of the posture with its movement pattern at alpha [rad]."""
    posture, pattern = scenario.plant.posture, scenario.plant.pattern
    return posture_angles(posture) + alpha * pattern_direction(pattern)


def oracle_posture(scenario, angles):
    """The oracle's posture for joint angles (15, 3) [rad]."""
    body = build_body(scenario.plant.subject)
    placed = configuration(body, angles)
    return oracle.Posture(placed.centre, placed.rotation, body.drag_area, body.total_mass, placed.inertia)


def oracle_constants(scenario):
    damping, hands = scenario.plant.damping, scenario.plant.hands
    return oracle.Constants(
        rho=scenario.plant.air.density_kg_m3,
        S=damping.reference_area_m2,
        L=damping.reference_length_m,
        Cm_roll=damping.Cm_damp_roll,
        Cm_pitch=damping.Cm_damp_pitch,
        K_N=hands.K_N,
        lx=hands.lx_m,
        force=hands.force,
        g=9.80665,
    )


def oracle_derivative(scenario, control):
    """The oracle's derivative of a state (13,) under a control (4,) in the posture of its alpha."""
    posture = oracle_posture(scenario, joint_angles(scenario, control[3]))
    constants = oracle_constants(scenario)
    return lambda state: oracle.state_derivative(state, control, posture, constants)


def falling_straight(scenario, speed):
    """State (13,) of a fall straight down at the scenario's initial pitch."""
    pitch, state = np.deg2rad(scenario.plant.initial.pitch_deg), np.zeros(13)
    state[4], state[6] = np.sin(pitch / 2), np.cos(pitch / 2)
    state[7], state[9] = speed * np.sin(pitch), -speed * np.cos(pitch)
    return state


def random_state(rng):
    """A tumbling state (13,): place, attitude, velocity [m/s] and rates [rad/s] at random."""
    attitude = Rotation.random(random_state=int(rng.integers(1 << 30))).as_quat()
    return np.concatenate([rng.normal(0, 1000, 3), attitude, rng.normal(0, 40, 3), rng.normal(0, 4, 3)])


def random_control(rng, scenario):
    """A control (4,) within the limits."""
    limits = scenario.plant.limits
    return np.array(limits.minimum) + rng.random(4) * np.subtract(limits.maximum, limits.minimum)
