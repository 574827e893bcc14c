# SPDX-License-Identifier: Apache-2.0
"""The layouts, open loop and tracked by UTC, beside their pinned metrics."""

import math

import numpy as np
import pytest

from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.analysis.skydiver import angle_turned_deg
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.parameters import load_scenario
from skydiver_utc.rotations import dorsal_axis_height, world_up

LAYOUTS = ["front_layout", "back_layout", "front_layout_open_loop", "back_layout_open_loop"]


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_layout_passes_through_head_down_and_ends_in_the_other_fall_in_its_own_posture(name):
    """In between the long axis points straight down within 3 deg, and the pitch angle has no jump there."""
    flight = simulate(load_scenario(name))
    values = metrics(flight)
    belly_at_the_end = name.startswith("back")
    assert values["outcome"] == "completed"
    assert values["facing"] == ("belly to earth" if belly_at_the_end else "back to earth")
    assert values["simulated_time_s"] - values["facing_since_s"] > 10.0
    last_ten_seconds = flight.time_s[:-1] > flight.time_s[-1] - 10.0
    np.testing.assert_allclose(
        flight.applied[last_ten_seconds, 3], 0.0 if belly_at_the_end else 2.0, atol=1e-9
    )
    height = dorsal_axis_height(flight.states)
    assert np.abs(height[:-1][last_ten_seconds]).min() > 0.95
    assert np.abs(np.rad2deg(flight.states[-1, 10:13])).max() < 0.5
    assert world_up(flight.states)[:, 0].min() < -math.cos(math.radians(3.0))
    assert np.abs(np.diff(angle_turned_deg(flight))).max() < 1.0


@pytest.mark.long
@pytest.mark.parametrize(("name", "bank_deg"), [*zip(LAYOUTS, (-10.0, 10.0, 10.0, -10.0), strict=True)])
def test_a_layout_comes_round_from_a_bank(name, bank_deg):
    on_the_back = name.startswith("back")
    banked = math.copysign(180.0, -bank_deg) + bank_deg if on_the_back else bank_deg
    values = metrics(simulate(load_scenario(name, {"plant.initial.bank_deg": banked})))
    assert values["facing"] == ("belly to earth" if on_the_back else "back to earth")
    assert values["facing_since_s"] < 6.0


def test_a_rotation_cut_short_has_no_angle_error():
    values = metrics(simulate(load_scenario("turn_360_left", {"duration_s": 3.0})))
    assert values["angle_error_deg"] is None
    assert values["rmse_rotating_deg_s"] is None
