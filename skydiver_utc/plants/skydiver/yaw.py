# SPDX-License-Identifier: Apache-2.0
"""The effect of the turning pattern on a straight fall: yaw acceleration at once, steady yaw rate in the end."""

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.plants.skydiver.model import PlantModel
from skydiver_utc.plants.skydiver.steady import HeldBody, SteadyFall, steady_turn

# Steps in pattern angle in which a steady fall is followed from one reported angle to the next.
_STEPS = 6


def yaw_acceleration(model: PlantModel, fall: SteadyFall, alpha: float) -> float:
    """Body acceleration about the dorsal axis [rad/s2] in a straight fall with a pattern angle put in at once."""
    body = HeldBody(model, np.array([0.0, 0.0, 0.0, alpha]))
    return float(body.accelerations(fall.up, fall.velocity, fall.rates)[5])


def steady_turns(
    model: PlantModel, fall: SteadyFall, alphas: Array, damping: float
) -> list[SteadyFall | None]:
    """The steady fall at each of the pattern angles [rad], which run away from 0, hands at rest.

    It is followed from the straight fall on; None from where it is lost.
    """
    found: list[SteadyFall | None] = []
    near: SteadyFall | None = fall
    reached = 0.0
    for alpha in alphas:
        for step in np.linspace(reached, alpha, _STEPS + 1)[1:]:
            if near is not None:
                near = steady_turn(HeldBody(model, np.array([damping, 0.0, 0.0, step])), near)
        reached = float(alpha)
        found.append(near)
    return found
