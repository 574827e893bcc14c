# SPDX-License-Identifier: Apache-2.0
"""The unscented Kalman filter beside others, with late and lost measurements, angles and attitudes."""

import numpy as np
import pytest
from kalman import KalmanFilter
from pendulums import DT_S, filter_of, pendulum, reading, swing, telemetry
from runs import cart
from scipy.spatial.transform import Rotation

from skydiver_utc.estimators.manifold import distance, moved
from skydiver_utc.loop.build import build_estimator, build_plant
from skydiver_utc.parameters import ParameterError, load_scenario, override
from skydiver_utc.plants.linear import LinearPlant


def measured_swing(steps=150):
    """Torques (K, 1) and angles (K,) of the pendulum, with noise."""
    rng, x = np.random.default_rng(0), np.array([0.7, 0.0])
    torques, angles = 2.0 * np.sin(0.1 * np.arange(steps))[:, None], np.empty(steps)
    for k in range(steps):
        angles[k] = x[0] + 0.05 * rng.standard_normal()
        x = swing(x, torques[k], DT_S)
        x[1] += 0.3 * np.sqrt(DT_S) * rng.standard_normal()
    return torques, angles


def test_on_a_linear_plant_it_is_the_kalman_filter():
    """Two sensors at their own rates, one of them with errors that are estimated."""
    rng, dt_s = np.random.default_rng(1), 0.1
    A = np.array([[1.0, 0.1, 0.0], [0.0, 0.9, 0.2], [-0.1, 0.0, 0.8]])
    B, C = np.array([[0.0, 0.1], [0.3, 0.0], [1.0, 0.2]]), np.array([[1.0, 0.0, 2.0]])
    settings = LinearPlant.Settings.model_validate(
        {"time": "discrete", "A": A.tolist(), "B": B.tolist(), "C": C.tolist(), "states": ("a", "b", "c")}
        | {"controls": ("u", "v"), "outputs": ("y",), "initial": (1.0, 0.0, 0.5)}
        | {"minimum": (-9.0, -9.0), "maximum": (9.0, 9.0)}
    )
    sensors = {
        "first": {"of": ("y", "b"), "rate_Hz": 10.0, "noise": 0.1, "bias_deviation": 0.3, "drift": 0.05},
        "second": {"of": ("c",), "rate_Hz": 5.0, "noise": 0.2},
    }
    spreads = {"initial_deviation": {"a": 1.0, "b": 0.5}, "process_noise": {"c": 0.3, "a": 0.1}, "angles": ()}
    tested = filter_of(LinearPlant(settings, dt_s), dt_s, sensors=sensors, **spreads)
    full_A, full_B = np.eye(5), np.zeros((5, 2))
    full_A[:3, :3], full_B[:3] = A, B
    P = np.diag([1.0, 0.25, 0.0, 0.09, 0.09])
    Q = dt_s * np.diag([0.01, 0.0, 0.09, 0.0025, 0.0025])
    oracle = KalmanFilter(full_A, full_B, np.array([1.0, 0.0, 0.5, 0.0, 0.0]), P, Q)
    H = np.array([[1.0, 0.0, 2.0, 1.0, 0.0], [0.0, 1.0, 0.0, 0.0, 1.0]])
    for k in range(60):
        readings = [reading(k, *rng.normal(size=2))]
        nis = [oracle.correct(H, 0.01 * np.eye(2), readings[0].values)]
        if k % 2 == 0:
            readings.append(reading(k, rng.normal(), sensor=1))
            nis.append(oracle.correct(np.eye(5)[2:3], np.array([[0.04]]), readings[1].values))
        state = tested.update(readings)
        np.testing.assert_allclose(state, oracle.x[:3], rtol=0, atol=1e-12)
        np.testing.assert_allclose(telemetry(tested, "bias_"), oracle.x[3:], rtol=0, atol=1e-12)
        np.testing.assert_allclose(
            telemetry(tested, "deviation_"), np.sqrt(oracle.P.diagonal()), rtol=0, atol=1e-12
        )
        np.testing.assert_allclose(telemetry(tested, "nis_")[: len(nis)], nis, rtol=1e-10)
        u = rng.normal(size=2)
        tested.predict(u)
        oracle.predict(u)


def test_on_a_nonlinear_plant_it_is_that_of_another_library():
    filterpy = pytest.importorskip("filterpy.kalman")
    scipy_linalg = pytest.importorskip("scipy.linalg")
    tested = filter_of(pendulum(), W0=0.25)
    # kappa / (n + kappa) is the weight of the centre.
    points = filterpy.JulierSigmaPoints(2, kappa=2 / 3, sqrt_method=lambda P: np.real(scipy_linalg.sqrtm(P)))
    other = filterpy.UnscentedKalmanFilter(2, 1, DT_S, lambda x: x[:1], None, points)
    other.x, other.P = np.array([0.5, 0.0]), np.diag([0.04, 0.16])
    other.Q, other.R = np.diag([0.0, 0.09 * DT_S]), np.array([[0.0025]])
    torques, angles = measured_swing()
    for k in range(len(angles)):
        # Points of the covariance with process noise, which it does not draw by itself.
        other.sigmas_f = points.sigma_points(other.x, other.P)
        other.update(angles[k])
        state = tested.update([reading(k, angles[k])])
        np.testing.assert_allclose(state, other.x, rtol=0, atol=1e-9)
        np.testing.assert_allclose(
            telemetry(tested, "deviation_"), np.sqrt(other.P.diagonal()), rtol=0, atol=1e-9
        )
        other.predict(fx=lambda x, dt, k=k: swing(x, torques[k], dt))
        tested.predict(torques[k])


def test_a_plain_plant_is_filtered_as_a_jitted_one():
    compiled, plain = filter_of(pendulum()), filter_of(pendulum(swing))
    torques, angles = measured_swing(20)
    for k in range(20):
        readings = [reading(k, angles[k])]
        np.testing.assert_allclose(compiled.update(readings), plain.update(readings), rtol=0, atol=1e-12)
        compiled.predict(torques[k])
        plain.predict(torques[k])


def test_late_measurements_in_any_order_count_as_if_they_had_come_in_time():
    in_time, late = filter_of(pendulum(), history_s=0.4), filter_of(pendulum(), history_s=0.4)
    torques, angles = measured_swing(100)
    rng, waiting = np.random.default_rng(3), []
    for k in range(100):
        expected = in_time.update([reading(k, angles[k])])
        waiting.append((k + int(rng.integers(0, 20)) if k < 80 else k, reading(k, angles[k])))
        due = [late_one for at, late_one in waiting if at <= k]
        waiting = [(at, late_one) for at, late_one in waiting if at > k]
        found = late.update(due[::-1])
        if k < 99:
            in_time.predict(torques[k])
            late.predict(torques[k])
    assert not waiting
    assert late.left_out == 0
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(telemetry(late, "deviation_"), telemetry(in_time, "deviation_"))


def test_a_measurement_older_than_the_history_or_published_again_changes_nothing():
    tested = filter_of(pendulum(), history_s=0.1)
    for k in range(20):
        expected = tested.update([reading(k, 0.5)])
        tested.predict(np.zeros(1))
    np.testing.assert_array_equal(tested.update([reading(20, 0.4)]), tested.update([reading(20, 0.4)]))
    assert not np.array_equal(tested.update([]), expected)
    before = tested.update([])
    np.testing.assert_array_equal(tested.update([reading(3, 9.0)]), before)
    assert tested.left_out == 1


def test_without_measurements_only_the_deviation_grows():
    tested, model = filter_of(pendulum(), initial_deviation={"angle": 1e-3}), pendulum()
    state, deviations = model.initial_state(), []
    for _ in range(50):
        tested.update([])
        deviations.append(telemetry(tested, "deviation_")[0])
        assert np.isnan(telemetry(tested, "nis_")).all()
        tested.predict(np.zeros(1))
        state = model.step(state, np.zeros(1), np.zeros(1))
    np.testing.assert_allclose(tested.update([]), state, atol=0.03)
    assert deviations[-1] > 10.0 * deviations[0]


def test_an_angle_that_is_measured_a_turn_further_is_the_same():
    once, around = filter_of(pendulum()), filter_of(pendulum())
    for k in range(30):
        np.testing.assert_allclose(
            once.update([reading(k, 0.5)]), around.update([reading(k, 0.5 + 2.0 * np.pi)]), atol=1e-9
        )
        once.predict(np.zeros(1))
        around.predict(np.zeros(1))


def test_a_rotation_vector_moves_an_attitude_there_and_back():
    rng = np.random.default_rng(4)
    for angle in (1e-12, 1e-4, 1.0, 3.1):
        attitude = Rotation.random(random_state=int(rng.integers(99)))
        error = np.concatenate([[0.3], angle * np.array([0.6, 0.0, 0.8]), [0.1]])
        state, reached, back = np.array([1.0, *attitude.as_quat(), 2.0]), np.empty(6), np.empty(5)
        moved(state, error, 1, reached)
        distance(state, reached, 1, np.empty(0, dtype=np.int64), back)
        expected = (attitude * Rotation.from_rotvec(error[1:4])).as_matrix()
        np.testing.assert_allclose(Rotation.from_quat(reached[1:5]).as_matrix(), expected, atol=1e-12)
        np.testing.assert_allclose(back, error, atol=1e-12)


def test_its_errors_do_not_depend_on_the_heading_or_on_a_vertical_body():
    """Body axes: a fall with the head down is one like another, and the heading is one number like another."""
    names = ("attitude_x", "attitude_y", "attitude_z", "vx", "vy", "vz", "wx", "wy", "wz")
    found = []
    for heading in (0.0, 137.0):
        changes = {"heading_deg": heading, "pitch_deg": 90.0, "bank_deg": 0.0}
        scenario = load_scenario(
            "straight_fall_gyro_accelerometer", {f"plant.initial.{n}": v for n, v in changes.items()}
        )
        plant = build_plant(scenario)
        tested = build_estimator(scenario, plant)
        for k in range(40):
            tested.update([reading(k, 0.01, 0.02, 0.03)] if k % 5 == 0 else [])
            tested.predict(plant.initial_applied())
        where = [tested.telemetry_names.index(f"deviation_{name}") for name in names]
        found.append(tested.telemetry[where])
        assert (found[-1] > 0.0).all()
    np.testing.assert_allclose(found[0], found[1], rtol=1e-3)


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({"sensors": {"encoder": {"rate_Hz": 10.0, "noise": 0.1}}}, "encoder"),
        ({"sensors": {"encoder": {"of": ["height"], "rate_Hz": 10.0, "noise": 0.1}}}, "height"),
        ({"sensors": {"encoder": {"of": ["place"], "rate_Hz": 1e4, "noise": 0.1}}}, "rate_Hz"),
        (
            {"sensors": {"encoder": {"of": ["place"], "rate_Hz": 1.0, "noise": 0.1, "bias": [1.0, 2.0]}}},
            "bias",
        ),
        ({"sensors": {}}, "sensors"),
        ({"process_noise": {"height": 1.0}}, "height"),
        ({"angles": ["height"]}, "height"),
    ],
)
def test_what_the_plant_does_not_have_is_refused_by_its_name(changes, name):
    sensors = {"encoder": {"of": ["place"], "rate_Hz": 10.0, "noise": 0.1}}
    block = {"kind": "unscented_kalman_filter", "sensors": sensors} | changes
    plant = build_plant(cart())
    with pytest.raises(ParameterError, match=name):
        build_estimator(override(cart(), {"estimator": block}), plant)
