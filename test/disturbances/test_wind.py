# SPDX-License-Identifier: Apache-2.0
"""Wind on the skydiver."""

from typing import Any

import numpy as np
import pytest
from runs import cart
from scipy.signal import welch
from scipy.spatial.transform import Rotation

from skydiver_utc.disturbances.dryden import OUTPUT, DrydenTurbulence, filters
from skydiver_utc.disturbances.protocol import Disturbance
from skydiver_utc.loop.build import build_disturbances, build_plant
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.loop.run import Run
from skydiver_utc.parameters import ParameterError, load_scenario


def flight(speed_m_s: float, duration_s: float, **settings: float) -> Run:
    """A fall with a gust from 1 s on."""
    gust = {"kind": "gust", "speed_m_s": speed_m_s, "start_s": 1.0, "duration_s": duration_s, **settings}
    changes = {"disturbances": [gust], "duration_s": 1.0 + duration_s, "plant.initial.bank_deg": 0.0}
    return simulate(load_scenario("bank_recovery", changes))


def disturbance(blocks: list[dict[str, Any]], **changes: Any) -> Disturbance:
    scenario = load_scenario("bank_recovery", {"disturbances": blocks} | changes)
    return build_disturbances(scenario, build_plant(scenario))


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
    # The controller measures the velocity over ground.
    measured = build_disturbances(run.scenario, run.plant).measurement(peak, run.states[peak])
    there = Rotation.from_quat(measured[3:7]).apply(measured[7:10])
    np.testing.assert_allclose(there[:2], over_ground(run, peak)[:2], atol=0.3)
    np.testing.assert_array_equal(np.delete(measured, [7, 8, 9]), np.delete(run.states[peak], [7, 8, 9]))


def test_the_body_drifts_about_as_far_as_the_air() -> None:
    """The mean of the wind is half of its peak; the body also glides a little, as it banks and turns."""
    assert flight(1.0, 30.0).states[-1, 1] == pytest.approx(15.0, abs=2.5)


def test_a_plant_without_a_velocity_is_refused() -> None:
    gust = {"kind": "gust", "speed_m_s": 1.0, "start_s": 1.0, "duration_s": 1.0}
    scenario = load_scenario("bank_recovery", {"disturbances": [gust]})
    with pytest.raises(ParameterError, match="wind"):
        build_disturbances(scenario, build_plant(cart()))


def test_in_a_steady_wind_the_body_drifts_and_falls_as_in_still_air() -> None:
    """To the last bit but for its place: the pose controller does not know the velocity."""
    wind = {"kind": "steady_wind", "speed_m_s": 8.0, "to_deg": 30.0, "up_deg": 20.0}
    still, moved = (
        simulate(load_scenario("slow_turn_pose_only", {"duration_s": 3.0, "disturbances": winds}))
        for winds in ([], [wind])
    )
    assert still.states[:, 3:].tobytes() == moved.states[:, 3:].tobytes()
    up, to = np.deg2rad([20.0, 30.0])
    velocity = 8.0 * np.array([np.cos(up) * np.cos(to), np.cos(up) * np.sin(to), np.sin(up)])
    drift = moved.states[-1, :3] - still.states[-1, :3]
    np.testing.assert_allclose(drift, velocity * moved.time_s[-1], rtol=1e-9)


def test_winds_add_up() -> None:
    """Two of turbulence have random numbers of their own, by their places in the list."""
    steady = {"kind": "steady_wind", "speed_m_s": 3.0, "to_deg": 0.0}
    gust = {"kind": "gust", "speed_m_s": 4.0, "to_deg": 90.0, "start_s": 0.0, "duration_s": 1.0}
    rough, calm = ({"kind": "dryden", "sigma_m_s": sigma} for sigma in (2.0, 0.0))
    k = 119
    even = disturbance([steady, gust]).wind(k)
    np.testing.assert_allclose(even, [3.0, 4.0, 0.0], atol=1e-3)
    both, first, second = (
        disturbance([steady, gust, *chosen]).wind(k) - even
        for chosen in ((rough, rough), (rough,), (calm, rough))
    )
    np.testing.assert_allclose(both, first + second, rtol=1e-12)
    assert not np.allclose(first, second)


def test_the_turbulence_of_a_step_depends_on_seed_and_step_alone() -> None:
    block = {"kind": "dryden", "sigma_m_s": 2.0}
    each, other = disturbance([block]), disturbance([block])
    series = np.array([each.wind(k) for k in range(1500)])
    picked = [1408, 1407, 0, 700, 701, 701, 3, 1499]
    np.testing.assert_array_equal([other.wind(k) for k in picked], series[picked])
    assert not np.allclose(disturbance([block], seed=1).wind(0), series[0])


@pytest.mark.parametrize("axis", ["along", "across"])
def test_the_covariance_from_step_to_step_is_that_of_dryden(axis: str) -> None:
    """exp(-s) along and (1 - s/2) exp(-s) across, s the distance in scale lengths; exact for a step of any length."""
    share = 0.037
    A, P = filters(share)
    row = OUTPUT[0 if axis == "along" else 1]
    since = share * np.arange(200)
    found = [row @ np.linalg.matrix_power(A, k) @ P @ row for k in range(200)]
    expected = np.exp(-since) * (1.0 if axis == "along" else 1.0 - 0.5 * since)
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_spectrum_and_variance_of_the_turbulence_are_the_published_ones() -> None:
    """MIL-F-8785C with the vertical as the longitudinal axis, from 1.8 hours at 20 Hz; 4.5 standard errors.

    Welch's estimate with K half overlapping Hann windows has a relative standard error of 1 / sqrt(0.95 K) at each
    frequency; the variance, with a correlation time t of at most L/V, one of sqrt(2 t / T).
    """
    sigma, scale, dt = 2.0, 533.4, 0.05
    plant = build_plant(load_scenario("bank_recovery", {"plant.initial.bank_deg": 0.0}))
    speed = float(np.linalg.norm(plant.initial_state()[7:10]))
    air = DrydenTurbulence(DrydenTurbulence.Settings(sigma_m_s=sigma), plant, dt, (3, 0))
    wind = np.array([air.wind(k) for k in range(2**17)])
    t, length = scale / speed, 2**12
    errors = 1.0 / np.sqrt(0.95 * (2 * len(wind) / length - 1))
    frequency, found = welch(wind, 1.0 / dt, nperseg=length, axis=0, detrend=False)
    band = (frequency > 0.03) & (frequency < 1.0)
    tw = t * 2.0 * np.pi * frequency[band]
    across = sigma**2 * t / np.pi * (1.0 + 3.0 * tw**2) / (1.0 + tw**2) ** 2
    along = 2.0 * sigma**2 * t / np.pi / (1.0 + tw**2)
    for axis, expected in enumerate((across, across, along)):
        ratio = found[band, axis] / (2.0 * np.pi * expected)
        assert np.abs(ratio - 1.0).max() < 4.5 * errors
        # Neighbouring frequencies share a Hann window.
        assert abs(ratio.mean() - 1.0) < 4.5 * errors / np.sqrt(len(ratio) / 2)
    variance = (wind**2).mean(axis=0) / sigma**2
    assert np.abs(variance - 1.0).max() < 4.5 * np.sqrt(2.0 * t / (len(wind) * dt))


def test_turbulence_needs_a_body_that_moves_through_the_air() -> None:
    with pytest.raises(ParameterError, match="dryden"):
        disturbance([{"kind": "dryden", "sigma_m_s": 2.0}], **{"plant.initial.fall_speed_m_s": 0.0})
