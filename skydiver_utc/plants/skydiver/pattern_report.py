# SPDX-License-Identifier: Apache-2.0
"""The effect of a movement pattern on a straight fall, at once and when it is held, as plain data."""

from typing import Any

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.body.segments import build_body
from skydiver_utc.parameters import Scenario
from skydiver_utc.plants.skydiver.linearise import linearise
from skydiver_utc.plants.skydiver.model import build_model
from skydiver_utc.plants.skydiver.steady import HeldBody, SteadyFall, steady_turns, straight_falls
from skydiver_utc.plants.skydiver.trim import in_posture

# Shares of the smallest and of the largest pattern angle that are shown.
_SHARES = np.array([1 / 3, 2 / 3, 1.0])


def pattern_report(scenario: Scenario) -> dict[str, Any]:
    """The effect of the scenario's pattern in its posture, which must fall straight; plain data."""
    given, model = scenario.plant, build_model(scenario.plant, scenario.dt_s)
    fall = straight_falls(model)[0]
    damping = given.initial.Cm_damp_yaw
    rows = []
    for end in filter(None, given.limits.alpha):
        alphas = end * _SHARES
        for alpha, steady in zip(alphas, steady_turns(model, fall, alphas, damping), strict=True):
            held = HeldBody(model, np.array([damping, 0.0, 0.0, alpha]))
            accelerations = held.accelerations(fall.up, fall.velocity, fall.rates)
            rows.append(
                {
                    "alpha_rad": float(alpha),
                    "acceleration_m_s2": accelerations[:3].tolist(),
                    "angular_acceleration_rad_s2": accelerations[3:].tolist(),
                    "steady": None if steady is None else _of_steady(held, steady),
                }
            )
    return {
        "pattern": given.pattern.name,
        "description": given.pattern.description,
        "source": given.pattern.source,
        "posture": given.posture.name,
        "subject": given.subject.name,
        "suit": given.subject.suit.name,
        "fall_rate_m_s": fall.fall_rate,
        "Cm_damp_yaw": damping,
        "at": sorted(rows, key=lambda row: row["alpha_rad"]),
    }


def _of_steady(held: HeldBody, fall: SteadyFall) -> dict[str, Any]:
    return {
        "stable": bool(np.linalg.eigvals(linearise(held, fall)).real.max() < 0.0),
        "fall_rate_m_s": fall.fall_rate,
        "glide_angle_deg": float(np.rad2deg(fall.glide_angle)),
        "glide_direction": fall.glide_direction,
        "pitch_deg": float(np.rad2deg(fall.pitch)),
        "bank_deg": float(np.rad2deg(fall.bank)),
        "yaw_rate_deg_s": float(np.rad2deg(fall.yaw_rate)),
    }


# What a positive value of each acceleration is called, in a fall belly to earth.
EFFECTS = ("headwards", "to the left", "slower fall", "rolls to the right", "head down", "turns left")
_STEP = 0.5


def pattern_effect(scenario: Scenario, posture: Array, direction: Array) -> Array:
    """Accelerations (6,) per rad of the pattern about a posture, both (15, 3): m/s2 along, rad/s2 about x, y, z.

    For a body that falls straight down at the scenario's initial speed and pitch, by the difference of half a
    radian to both sides.
    """
    initial = scenario.plant.initial
    body, model = build_body(scenario.plant.subject), build_model(scenario.plant, scenario.dt_s)
    fall = initial.fall_speed_m_s, float(np.deg2rad(initial.pitch_deg))
    bodies = (in_posture(body, model, posture + side * _STEP * direction) for side in (1.0, -1.0))
    more, less = (held.straight_down(*fall) for held in bodies)
    difference: Array = (more - less) / (2.0 * _STEP)
    return difference
