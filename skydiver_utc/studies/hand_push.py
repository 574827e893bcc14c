"""What a hand alone does to the straight fall, with no controller in the way."""

import msgspec
import numpy as np

from skydiver_utc.simulation.build import build_plant
from skydiver_utc.studies.runs import Run

_SECONDS = 1.0


class HandPush(msgspec.Struct, frozen=True):
    """Bank to the right [deg] and yaw rate to the left [deg/s] after the left hand was pressed fully for 1 s."""

    bank_right_deg: float
    yaw_rate_deg_s: float


def hand_push(run: Run) -> HandPush:
    """Press the left hand of the scenario's skydiver, in a straight fall."""
    scenario = run.load()
    plant = build_plant(scenario)
    state, held = plant.initial_state(), plant.initial_applied()
    pressed = plant.initial_control()
    pressed[2] = scenario.plant.limits.k_left[1]
    for _ in range(round(_SECONDS / scenario.dt_s)):
        before, held = held, plant.actuate(pressed, held)
        state = plant.step(state, before, held)
    x, y, z, w = state[3:7]
    left_axis_height = 2.0 * (y * z + x * w)
    return HandPush(
        bank_right_deg=round(float(np.rad2deg(np.arcsin(left_axis_height))), 3),
        yaw_rate_deg_s=round(float(np.rad2deg(state[12])), 3),
    )
