# SPDX-License-Identifier: Apache-2.0
"""A gust of wind on the skydiver."""

import numpy as np
import pytest
from runs import cart
from scipy.spatial.transform import Rotation

from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.loop.registry import build_disturbances, build_plant
from skydiver_utc.loop.run import Run
from skydiver_utc.parameters import ParameterError, load_scenario


def flight(speed_m_s: float, duration_s: float, **settings: float) -> Run:
    """A fall with a gust from 1 s on."""
    gust = {"kind": "gust", "speed_m_s": speed_m_s, "start_s": 1.0, "duration_s": duration_s, **settings}
    changes = {"disturbances": [gust], "duration_s": 1.0 + duration_s, "plant.initial.bank_deg": 0.0}
    return simulate(load_scenario("bank_recovery", changes))


def over_ground(run: Run, k: int) -> np.ndarray:
    """Velocity (3,) in the world from the change of place, halfway between two steps."""
    dt_s = run.scenario.dt_s
    return (run.states[k + 1, :3] - run.states[k, :3]) / dt_s


def test_a_short_gust_leaves_the_velocity_over_ground_and_changes_that_in_the_air() -> None:
    """In a tenth of a second the body has no time to follow the wind: at its peak it falls straight down."""
    run = flight(10.0, 0.1, to_deg=30.0)
    peak = round(1.05 / run.scenario.dt_s)
    in_air = Rotation.from_quat(run.states[peak, 3:7]).apply(run.states[peak, 7:10])
    wind = 10.0 * np.array([np.cos(np.pi / 6), 0.5])
    np.testing.assert_allclose(in_air[:2], -wind, atol=0.3)
    np.testing.assert_allclose(over_ground(run, peak)[:2], 0.0, atol=0.3)


def test_the_body_drifts_about_as_far_as_the_air() -> None:
    """The mean of the wind is half of its peak; the body also glides a little, as it banks and turns."""
    assert flight(1.0, 30.0).states[-1, 1] == pytest.approx(15.0, abs=2.5)


def test_the_controller_measures_the_velocity_over_ground() -> None:
    run = flight(10.0, 0.1)
    (gust,) = build_disturbances(run.scenario, run.plant)
    peak = round(1.05 / run.scenario.dt_s)
    measured = gust.measurement(peak, run.states[peak])
    there = Rotation.from_quat(measured[3:7]).apply(measured[7:10])
    np.testing.assert_allclose(there[:2], over_ground(run, peak)[:2], atol=0.3)
    np.testing.assert_array_equal(np.delete(measured, [7, 8, 9]), np.delete(run.states[peak], [7, 8, 9]))


def test_a_plant_without_a_velocity_is_refused() -> None:
    gust = {"kind": "gust", "speed_m_s": 1.0, "start_s": 1.0, "duration_s": 1.0}
    scenario = load_scenario("bank_recovery", {"disturbances": [gust]})
    with pytest.raises(ParameterError, match="gust"):
        build_disturbances(scenario, build_plant(cart()))
