# SPDX-License-Identifier: Apache-2.0
"""Sensors: true values with errors that depend on seed, sensor and number of the measurement alone."""

import numpy as np
import pytest
from pendulums import DT_S, pendulum
from scipy.spatial.transform import Rotation
from skydivers import random_control, random_state

from skydiver_utc.estimators.sensors import Sensors
from skydiver_utc.estimators.settings import SensorSettings
from skydiver_utc.loop.build import build_plant
from skydiver_utc.loop.plant_steps import PlantSteps
from skydiver_utc.parameters import ParameterError, load_scenario, override

STILL = np.array([0.5, -1.0])


def arrived(steps=1000, seed=7, **sensors):
    """All readings, each with the step at which it arrives."""
    settings = {
        name: SensorSettings.model_validate({"rate_Hz": 50.0} | given) for name, given in sensors.items()
    }
    tested = Sensors(settings, pendulum(), DT_S, seed)
    return [(k, found) for k in range(steps) for found in tested.read(k, STILL, STILL, np.zeros(1))]


def values(found):
    return np.array([reading.values for _, reading in found])


def test_errors_have_the_deviations_of_the_settings():
    found = arrived(4000, angle={"of": ["rate"], "noise": 0.2, "bias": 0.3})
    assert len(found) == 4000
    assert values(found).mean() == pytest.approx(-0.7, abs=0.02)
    assert values(found).std() == pytest.approx(0.2, rel=0.05)
    drifting = values(arrived(4000, angle={"of": ["rate"], "noise": 1e-9, "drift": 0.4}))
    assert drifting[0, 0] == pytest.approx(-1.0)
    assert np.diff(drifting[:, 0]).std() == pytest.approx(0.4 * np.sqrt(DT_S), rel=0.05)


def test_measurements_do_not_depend_on_other_sensors_on_delay_or_on_loss():
    angle = {"of": ["angle"], "noise": 0.1, "drift": 0.1}
    alone = arrived(angle=angle)
    beside = [(k, r) for k, r in arrived(rate={"of": ["rate"], "noise": 1.0}, angle=angle) if r.sensor == 1]
    np.testing.assert_array_equal(values(alone), values(beside))
    late = arrived(angle=angle | {"delay_s": 0.05})
    assert {k - reading.step for k, reading in late} == {3}
    np.testing.assert_array_equal(values(late), values(alone)[:-3])
    kept = arrived(angle=angle | {"loss": 0.3})
    assert len(kept) == pytest.approx(700, abs=50)
    np.testing.assert_array_equal(values(kept), values(alone)[[reading.step for _, reading in kept]])
    assert not np.array_equal(values(arrived(angle=angle, seed=8)), values(alone))


def test_a_rate_between_those_of_steps_is_kept_on_the_mean():
    steps = [
        reading.step for _, reading in arrived(500, angle={"of": ["angle"], "noise": 0.1, "rate_Hz": 48.0})
    ]
    assert len(steps) == 480
    assert set(np.diff(steps)) == {1, 2}


@pytest.fixture(scope="module")
def skydiver():
    scenario = load_scenario("fast_turn_gyro_accelerometer", {"plant.limbs.reaction": False})
    return scenario, build_plant(scenario)


def test_an_accelerometer_measures_the_acceleration_without_gravity(skydiver):
    """Beside the plant's own change of velocity in the world over a short step."""
    scenario, plant = skydiver
    rng, dt_s = np.random.default_rng(5), 1e-5
    model = plant.model_of_step(dt_s)
    short = model.bound(4, 4)
    sensors = {"accelerometer": SensorSettings(rate_Hz=200.0, noise=1e-12)}
    for _ in range(5):
        state, following = random_state(rng), np.empty(13)
        control = np.append(random_control(rng, scenario), np.nan)[:4]  # nothing behind it is read
        short.step(state, control, following)
        before, after = (Rotation.from_quat(s[3:7]).apply(s[7:10]) for s in (state, following))
        specific = (after - before) / dt_s + [0.0, 0.0, 9.80665]
        (reading,) = Sensors(sensors, plant, scenario.dt_s, 0).read(0, state, state, control)
        expected = Rotation.from_quat(state[3:7]).inv().apply(specific)
        np.testing.assert_allclose(reading.values, expected, rtol=1e-3, atol=0.05)


def test_an_accelerometer_feels_the_air_on_moving_limbs_and_disturbs_no_step():
    """The sum of the forces on the segments; the step after it is the one without it."""
    scenario = load_scenario("fast_turn_gyro_accelerometer", {"plant.limbs.reaction": True})
    plant, state = build_plant(scenario), random_state(np.random.default_rng(7))
    before, applied = np.array([0.5, 0.1, 0.3, 0.4, -3.0]), np.array([0.6, 0.2, 0.1, 0.41, 3.0])
    still = np.array([0.5, 0.1, 0.3, 0.2, 0.0])
    sensors = {"accelerometer": SensorSettings(rate_Hz=200.0, noise=1e-12)}
    expected = plant.step(state, still, still)
    control = plant.step_control(before, applied)
    (reading,) = Sensors(sensors, plant, scenario.dt_s, 0).read(0, state, state, control)
    np.testing.assert_array_equal(plant.step(state, still, still), expected)
    force = Rotation.from_quat(state[3:7]).inv().apply(plant.shape_forces(state, applied).sum(axis=0))
    np.testing.assert_allclose(reading.values, force / plant.constants.mass, rtol=1e-9)


def test_the_others_measure_rates_field_pressure_and_velocity(skydiver):
    scenario, plant = skydiver
    names = ("gyroscope", "magnetometer", "barometer", "gnss_velocity")
    sensors = {name: SensorSettings(rate_Hz=10.0, noise=1e-12) for name in names}
    state = random_state(np.random.default_rng(6))
    state[2] = 3000.0
    attitude = Rotation.from_quat(state[3:7])
    control = plant.initial_control()
    rates, field, pressure, velocity = (
        r.values for r in Sensors(sensors, plant, scenario.dt_s, 0).read(0, state, state, control)
    )
    np.testing.assert_allclose(rates, state[10:], atol=1e-9)
    np.testing.assert_allclose(attitude.apply(field), 5e-5 * np.array([0.0, 0.5, -np.sqrt(0.75)]), atol=1e-10)
    # The standard atmosphere's table at 3000 m.
    assert pressure[0] == pytest.approx(70108.5, abs=0.1)
    np.testing.assert_allclose(velocity, attitude.apply(state[7:10]), atol=1e-9)


def test_in_a_wind_the_velocity_is_that_over_ground_and_the_acceleration_that_of_the_air():
    wind = {"kind": "steady_wind", "speed_m_s": 8.0, "to_deg": 90.0}
    sensors = {name: {"rate_Hz": 10.0, "noise": 1e-12} for name in ("gnss_velocity", "accelerometer")}
    found = []
    for winds in ([], [wind]):
        scenario = load_scenario("fast_turn_gyro_accelerometer", {"disturbances": winds})
        steps = PlantSteps(override(scenario, {"estimator.sensors": sensors}))
        steps.begin()
        found.append([reading.values for reading in steps.readings])
    (velocity, force), (moved, same) = found
    np.testing.assert_allclose(moved - velocity, [0.0, 8.0, 0.0], atol=1e-9)
    np.testing.assert_array_equal(same, force)


def test_errors_of_a_measured_state_are_refused_beside_sensors():
    noise = {"kind": "measurement_error", "noise": {"rates_deg_s": 1.0}}
    scenario = load_scenario("fast_turn_gyro_accelerometer", {"disturbances": [noise]})
    with pytest.raises(ParameterError, match="sensors"):
        PlantSteps(scenario)
