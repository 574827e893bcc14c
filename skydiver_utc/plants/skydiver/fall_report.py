# SPDX-License-Identifier: Apache-2.0
"""The straight fall of a posture, its modes and its turning, as plain data."""

from typing import Any

import numpy as np

from skydiver_utc.body.posture import configuration, posture_angles, refuse_beyond
from skydiver_utc.parameters import ParameterError, PosturePath, Scenario
from skydiver_utc.plants.skydiver.linearise import linearise
from skydiver_utc.plants.skydiver.model import PlantModel, build_model, dressed_body
from skydiver_utc.plants.skydiver.modes import modes
from skydiver_utc.plants.skydiver.steady import (
    HeldBody,
    SteadyFall,
    steady_turns,
    straight_falls,
    yaw_acceleration,
)

# Shares of the largest pattern angle and of the largest yaw damping at which steady turns are shown.
_ALPHA_SHARES = (0.25, 0.5, 0.75, 1.0)
_DAMPING_SHARES = (1 / 12, 1 / 3, 2 / 3, 1.0)


def fall_report(scenario: Scenario) -> dict[str, Any]:
    """The straight fall of a scenario's posture and subject, plain data."""
    _check(scenario)
    plant = scenario.plant
    body, model = dressed_body(plant), build_model(plant, scenario.dt_s)
    placed = configuration(body, posture_angles(plant.posture))
    try:
        fall, *others = straight_falls(model)
    except ParameterError as error:
        raise ParameterError(f"posture {plant.posture.name}: {error}") from error
    control = np.array([plant.initial.Cm_damp_yaw, 0.0, 0.0, 0.0])
    return {
        "posture": plant.posture.name,
        "subject": plant.subject.name,
        "scenario": scenario.name,
        "air_density_kg_m3": plant.air.density_kg_m3,
        "mass_kg": model.mass,
        "centre_of_mass_m": placed.centre_of_mass.tolist(),
        "inertia_kg_m2": placed.inertia.tolist(),
        "joint_angles_deg": {joint: list(row) for joint, row in plant.posture.joint_angles_deg.items()},
        **_of_fall(fall),
        "Cm_damp_yaw": plant.initial.Cm_damp_yaw,
        "modes": [mode.as_dict() for mode in modes(linearise(HeldBody(model, control), fall), fall)],
        "other_falls": [_of_fall(other) for other in others],
        "turning": _of_turning(model, fall),
    }


def _check(scenario: Scenario) -> None:
    """Refuse what has no posture at rest at pattern angle 0, and a posture that the body cannot take."""
    plant = scenario.plant
    posture, pattern, (lowest, largest) = plant.posture, plant.pattern, plant.limits.alpha
    if isinstance(pattern, PosturePath):
        raise ParameterError(
            f"pattern {pattern.name} is a path through postures, trim needs a movement pattern: choose"
            " another --scenario, or --set plant.pattern=turn"
        )
    if not lowest <= 0.0 <= largest:
        raise ParameterError(
            f"plant.limits.alpha from {lowest:g} to {largest:g} leaves out 0, the posture at rest: widen it"
        )
    refuse_beyond(plant.subject.joint_limits, posture_angles(posture), f"posture {posture.name}")


def _of_fall(fall: SteadyFall) -> dict[str, Any]:
    linear, angular = np.abs(fall.residual).reshape(2, 3).max(axis=1).tolist()
    return {
        "facing": fall.facing,
        "statically_stable_in_pitch": fall.pitch_stiffness > 0.0,
        "speed_m_s": fall.speed,
        "fall_rate_m_s": fall.fall_rate,
        "glide_angle_deg": float(np.rad2deg(fall.glide_angle)),
        "glide_direction": fall.glide_direction,
        "pitch_deg": float(np.rad2deg(fall.pitch)),
        "up_in_body": fall.up.tolist(),
        "velocity_in_body_m_s": fall.velocity.tolist(),
        "residual_m_s2": linear,
        "residual_rad_s2": angular,
    }


def _of_turning(model: PlantModel, fall: SteadyFall) -> dict[str, Any]:
    alphas = np.array(_ALPHA_SHARES) * model.control_max[3]
    rows = []
    for damping in np.array(_DAMPING_SHARES) * model.control_max[0]:
        turns = steady_turns(model, fall, alphas, float(damping))
        in_deg = [None if turn is None else float(np.rad2deg(turn.yaw_rate)) for turn in turns]
        rows.append({"Cm_damp_yaw": float(damping), "yaw_rate_deg_s": in_deg})
    return {
        "yaw_acceleration_rad_s2": yaw_acceleration(model, fall, model.control_max[3]),
        "alpha_rad": alphas.tolist(),
        "steady": rows,
    }
