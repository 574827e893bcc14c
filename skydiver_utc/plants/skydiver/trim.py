# SPDX-License-Identifier: Apache-2.0
"""Straight fall: the posture and speed at which a skydiver falls without accelerating or turning."""

from dataclasses import dataclass

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.body.posture import joint_ranges, joint_rows, posture_angles
from skydiver_utc.body.segments import JOINTS, Body, build_body
from skydiver_utc.parameters import ParameterError, Posture, Scenario
from skydiver_utc.plants.skydiver.model import PlantModel, build_model, held_row
from skydiver_utc.plants.skydiver.steady import LARGEST_RESIDUAL, HeldBody

# Decimals of a degree, and of a component: rounding leaves less than 1e-6 of acceleration.
DECIMALS = 9
# The joint angles that a straight fall may change, both sides alike: joint and column.
FREE_ANGLES = (("hip", 0), ("knee", 0), ("shoulder", 0), ("shoulder", 1), ("shoulder", 2), ("elbow", 0))


@dataclass(frozen=True, eq=False)
class Trim:
    """A straight fall: joint angles (15, 3) [rad], speed [m/s], pitch [rad], and what is left of acceleration."""

    angles: Array
    speed: float
    pitch: float
    residual: Array


def in_posture(body: Body, model: PlantModel, angles: Array) -> HeldBody:
    """A body that holds the joint angles (15, 3) [rad], controls at rest."""
    return HeldBody(model, np.zeros(4), held_row(body, angles))


def straight_fall(scenario: Scenario, posture: Posture, pitch_deg: float) -> Trim:
    """The posture nearest to the given one, over `FREE_ANGLES`, that falls straight at a pitch.

    Least squares in the joint angles, within the joint limits, under three equations: no acceleration along
    x and z, none about y.
    """
    from scipy.optimize import NonlinearConstraint, minimize

    body, pitch = build_body(scenario.plant.subject), float(np.deg2rad(pitch_deg))
    model = build_model(scenario.plant, scenario.dt_s)
    typical = posture_angles(posture)
    free = [(JOINTS.index(f"left_{joint}"), column) for joint, column in FREE_ANGLES]
    start: Array = np.array([typical[place] for place in free])
    lower, upper = joint_ranges(scenario.plant.subject.joint_limits)
    speed_unit = 50.0

    def placed(values: Array) -> Array:
        angles = typical.copy()
        for (row, column), value in zip(free, values, strict=True):
            angles[[row, row + 1], column] = value
        return angles

    def balance(x: Array) -> Array:
        return in_posture(body, model, placed(x[:-1])).straight_down(x[-1] * speed_unit, pitch)[[0, 2, 4]]

    def distance(x: Array) -> float:
        return float(((x[:-1] - start) ** 2).sum())

    first_guess: Array = np.concatenate([start, [1.1]])
    bounds = [(lower[place], upper[place]) for place in free]
    found = minimize(
        distance,
        first_guess,
        bounds=[*bounds, (0.2, 3.0)],
        constraints=NonlinearConstraint(balance, 0.0, 0.0),
        method="SLSQP",
        options={"maxiter": 500, "ftol": 1e-14},
    )
    angles, speed = placed(found.x[:-1]), float(found.x[-1] * speed_unit)
    residual = in_posture(body, model, angles).straight_down(speed, pitch)
    if not np.abs(residual).max() < LARGEST_RESIDUAL:
        raise ParameterError(
            f"posture {posture.name} has no straight fall at a pitch of {pitch_deg} deg:"
            f" {np.abs(residual).max():.2g} of acceleration is left; choose another posture or pitch"
        )
    return Trim(angles, speed, pitch, residual)


def trimmed_posture(scenario: Scenario, trim: Trim, name: str) -> Posture:
    """A straight fall of the scenario's posture as a posture with its source, rounded as in a file."""
    plant = scenario.plant
    return Posture(
        name=name,
        description=(
            f"Belly to earth with the head low; subject {plant.subject.name} falls straight down at"
            f" {trim.speed:.2f} m/s"
        ),
        source=(
            f"Straight fall nearest to posture {plant.posture.name} at a pitch of {plant.initial.pitch_deg:g} deg, by"
            f" skydiver-utc pattern neutral: segments {plant.subject.segments.name}, suit {plant.subject.suit.name},"
            f" joint limits {plant.subject.joint_limits.name}"
        ),
        joint_angles_deg=joint_rows(np.rad2deg(trim.angles).round(DECIMALS)),
    )


def in_straight_fall(scenario: Scenario) -> Scenario:
    """The scenario with its posture moved, by as little as it takes, to fall straight down at its initial pitch.

    The initial speed becomes that of this fall.
    """
    plant = scenario.plant
    found = straight_fall(scenario, plant.posture, plant.initial.pitch_deg)
    posture = plant.posture.replace(joint_angles_deg=joint_rows(np.rad2deg(found.angles)))
    initial = plant.initial.replace(fall_speed_m_s=found.speed)
    trimmed: Scenario = scenario.replace(plant=plant.replace(posture=posture, initial=initial))
    return trimmed
