# SPDX-License-Identifier: Apache-2.0
"""The maneuvers beyond the fast turn: whole turns by the pose controller, layouts open loop and tracked by UTC."""

import math
from functools import cache

import numpy as np
import pytest
from scipy.integrate import trapezoid

from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.analysis.skydiver import angle_turned_deg
from skydiver_utc.loop.build import build_reference
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.parameters import ParameterError, load_scenario
from skydiver_utc.rotations import dorsal_axis_height, world_up

LAYOUTS = ["front_layout", "back_layout", "front_layout_open_loop", "back_layout_open_loop"]


@cache
def flown(name):
    return simulate(load_scenario(name))


def test_a_rotation_turns_by_its_angle():
    """The profile's integral is the angle; the trapezoidal rule is exact to rounding for a whole cosine period."""
    scenario = load_scenario("turn_360_left", {"reference.angle_deg": 123.0, "reference.duration_s": 4.2})
    values = build_reference(scenario).preview(0, scenario.steps + 1)[:, 0]
    assert trapezoid(values, dx=scenario.dt_s) == pytest.approx(math.radians(123.0), rel=1e-6)
    assert values.max() == pytest.approx(math.radians(2 * 123.0 / 4.2), rel=1e-4)
    assert not values[: math.floor(1.0 / scenario.dt_s) + 1].any()


def test_a_posture_reference_goes_in_straight_lines():
    reference, dt = build_reference(load_scenario("front_layout_open_loop")), 0.0042
    assert reference.outputs == ("alpha",)
    values = [reference.preview(round(time / dt), 1)[0, 0] for time in (0.0, 2.5, 10.0)]
    assert values == pytest.approx([0.0, 1.0, 2.0], abs=0.002)
    assert (values[0], values[2]) == (0.0, 2.0)


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_layout_ends_in_the_other_fall_in_its_own_posture_and_stays(name):
    flight = flown(name)
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


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_layout_passes_through_head_down(name):
    """The long axis points straight down in between, within 3 deg, and the pitch angle has no jump there."""
    flight = flown(name)
    assert world_up(flight.states)[:, 0].min() < -math.cos(math.radians(3.0))
    assert np.abs(np.diff(angle_turned_deg(flight))).max() < 1.0


@pytest.mark.parametrize(
    ("name", "rmse", "largest"), [("front_layout", 5.7, 18.8), ("back_layout", 6.6, 22.3)]
)
def test_utc_tracks_the_pitch_rate_of_a_layout(name, rmse, largest):
    """As docs/maneuvers.md has it; the peak of the reference is 66 deg/s."""
    values = metrics(flown(name))
    assert values["rmse_rotating_deg_s"] < rmse
    assert values["max_abs_error_deg_s"] < largest
    assert abs(values["angle_error_deg"]) < 1.0


@pytest.mark.long
@pytest.mark.parametrize(("name", "bank_deg"), zip(LAYOUTS, (-10.0, 10.0, 10.0, -10.0), strict=True))
def test_a_layout_comes_round_from_a_bank(name, bank_deg):
    on_the_back = name.startswith("back")
    banked = math.copysign(180.0, -bank_deg) + bank_deg if on_the_back else bank_deg
    values = metrics(simulate(load_scenario(name, {"plant.initial.bank_deg": banked})))
    assert values["facing"] == ("belly to earth" if on_the_back else "back to earth")
    assert values["facing_since_s"] < 6.0


def test_whole_turns_end_where_they_should_and_mirror_each_other():
    for name, angle in (("turn_360_left", 360.0), ("turn_360_right", -360.0)):
        values = metrics(flown(name))
        assert values["outcome"] == "completed"
        assert abs(values["angle_error_deg"]) < 1.0
        assert values["overshoot_deg"] < 1.0
        assert angle_turned_deg(flown(name))[-1] == pytest.approx(angle, abs=1.0)


def test_a_rotation_cut_short_has_no_angle_error():
    values = metrics(simulate(load_scenario("turn_360_left", {"duration_s": 3.0})))
    assert values["angle_error_deg"] is None
    assert values["rmse_rotating_deg_s"] is None


def test_a_reference_that_is_none_is_refused():
    with pytest.raises(ParameterError, match="points"):
        load_scenario("front_layout_open_loop", {"reference.points": []})
    with pytest.raises(ParameterError, match=r"0\.0001 s"):
        build_reference(load_scenario("turn_360_left", {"reference.duration_s": 0.0001}))
