# SPDX-License-Identifier: Apache-2.0
"""The effect of a small part of a movement pattern on a falling body, whatever else the body does."""

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.body.segments import build_body
from skydiver_utc.parameters import Scenario
from skydiver_utc.plants.skydiver.model import build_model
from skydiver_utc.plants.skydiver.trim import in_posture

Array = NDArray[np.float64]

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
    more, less = (
        in_posture(body, model, posture + side * _STEP * direction).straight_down(
            initial.fall_speed_m_s, float(np.deg2rad(initial.pitch_deg))
        )
        for side in (1.0, -1.0)
    )
    difference: Array = (more - less) / (2.0 * _STEP)
    return difference
