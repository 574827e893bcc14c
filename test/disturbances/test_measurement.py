# SPDX-License-Identifier: Apache-2.0
"""Errors of what is measured: noise, bias, drift, delay, jitter, loss."""

from collections import Counter
from typing import Any

import numpy as np
import pytest
from runs import cart
from scipy.spatial.transform import Rotation

from skydiver_utc.disturbances.protocol import Disturbance
from skydiver_utc.loop.build import build_disturbances, build_plant
from skydiver_utc.parameters import ParameterError, load_scenario, override

STEPS = 20_000
DT_S = 0.05


def of_cart(*blocks: dict[str, Any], seed: int = 0) -> Disturbance:
    scenario = override(cart(), {"disturbances": list(blocks), "seed": seed})
    return build_disturbances(scenario, build_plant(scenario))


def measured(disturbance: Disturbance) -> np.ndarray:
    """What is measured (STEPS, 2) where the state is (k, 0)."""
    return np.array([disturbance.measurement(k, np.array([float(k), 0.0])) for k in range(STEPS)])


def errors(**settings: Any) -> np.ndarray:
    """Measured less true state (STEPS, 2)."""
    found = measured(of_cart({"kind": "measurement_error", **settings}))
    found[:, 0] -= np.arange(STEPS)
    return found


def test_noise_has_its_deviation_and_no_memory() -> None:
    """Within 4.5 standard errors of a sample of this size."""
    found = errors(noise={"speed": 0.3})
    assert np.all(found[:, 0] == 0.0)
    assert found[:, 1].std() == pytest.approx(0.3, rel=4.5 / np.sqrt(2 * STEPS))
    assert abs(found[:, 1].mean()) < 0.3 * 4.5 / np.sqrt(STEPS)
    assert abs(np.corrcoef(found[1:, 1], found[:-1, 1])[0, 1]) < 4.5 / np.sqrt(STEPS)


def test_the_noise_is_no_generators_of_the_seed_alone() -> None:
    """A controller that draws, as MPPI does, has that one."""
    own = np.random.default_rng(3).standard_normal(200)
    noisy = of_cart({"kind": "measurement_error", "noise": {"place": 1.0}}, seed=3)
    found = [noisy.measurement(k, np.zeros(2))[0] for k in range(100)]
    assert not set(found) & set(own.tolist())


def test_a_bias_is_the_same_at_each_step() -> None:
    np.testing.assert_allclose(errors(bias={"place": -2.0, "speed": 0.5}), [[-2.0, 0.5]] * STEPS, atol=1e-9)


def test_a_drift_begins_at_zero_and_gains_its_variance_per_second() -> None:
    walk = errors(drift={"speed": 0.2})[:, 1]
    assert walk[0] == 0.0
    steps = np.diff(walk)
    assert steps.std() == pytest.approx(0.2 * np.sqrt(DT_S), rel=4.5 / np.sqrt(2 * STEPS))
    assert abs(np.corrcoef(steps[1:], steps[:-1])[0, 1]) < 4.5 / np.sqrt(STEPS)


def test_a_delay_shifts_the_states_by_its_steps() -> None:
    found = measured(of_cart({"kind": "transmission", "delay_s": 7 * DT_S}))
    np.testing.assert_array_equal(found[:, 0], np.maximum(np.arange(STEPS) - 7, 0))


def test_a_lost_state_leaves_the_one_before_in_use() -> None:
    """The age of what is measured is that of a geometric distribution."""
    ages = np.arange(STEPS) - measured(of_cart({"kind": "transmission", "loss": 0.2}))[:, 0]
    for age in range(4):
        share = 0.8 * 0.2**age
        error = np.sqrt(share * (1.0 - share) / STEPS * 1.5)  # ages of neighbours are correlated
        assert np.mean(ages == age) == pytest.approx(share, abs=4.5 * error)


def test_jitter_delays_by_up_to_its_steps_and_never_goes_back() -> None:
    found = measured(of_cart({"kind": "transmission", "delay_s": 2 * DT_S, "jitter_s": 3 * DT_S}))[:, 0]
    ages = Counter((np.arange(STEPS) - found)[10:].astype(int).tolist())
    # The newest of four that are late by up to three more steps: 1 - 3/4, 3/4 (1 - 2/4), 3/4 2/4 (1 - 1/4), the rest.
    for age, share in zip((2, 3, 4, 5), (1 / 4, 3 / 8, 9 / 32, 3 / 32), strict=True):
        assert ages[age] / (STEPS - 10) == pytest.approx(share, abs=4.5 * np.sqrt(share / STEPS * 2.0))
    assert sum(ages[age] for age in (2, 3, 4, 5)) == STEPS - 10
    assert (np.diff(found) >= 0.0).all()


ALL = (
    {"kind": "measurement_error", "noise": {"speed": 1.0}, "drift": {"place": 1.0}},
    {"kind": "transmission", "delay_s": 2 * DT_S, "jitter_s": 3 * DT_S, "loss": 0.3},
)


def test_the_same_seed_gives_the_same_bits_also_to_one_that_asks_twice() -> None:
    first, second, twice = measured(of_cart(*ALL)), measured(of_cart(*ALL)), of_cart(*ALL)
    assert first.tobytes() == second.tobytes()
    assert not np.allclose(first, measured(of_cart(*ALL, seed=1)))
    for k in range(50):
        for _ in range(2):
            np.testing.assert_array_equal(twice.measurement(k, np.array([float(k), 0.0])), first[k])
    twice.reset()
    np.testing.assert_array_equal(twice.measurement(0, np.zeros(2)), first[0])


def test_groups_of_an_odometry_are_in_the_units_of_their_names() -> None:
    noise = {"position_m": 2.0, "attitude_deg": 3.0, "velocity_m_s": 0.5, "rates_deg_s": 4.0, "vz": 0.1}
    scenario = load_scenario(
        "bank_recovery", {"disturbances": [{"kind": "measurement_error", "noise": noise}]}
    )
    plant = build_plant(scenario)
    state, error = plant.initial_state(), build_disturbances(scenario, plant)
    count = 4000
    found = np.array([error.measurement(k, state) for k in range(count)])
    turn = (Rotation.from_quat(state[3:7]).inv() * Rotation.from_quat(found[:, 3:7])).as_rotvec()
    within = 4.5 / np.sqrt(2 * count)
    np.testing.assert_allclose(found[:, :3].std(axis=0), 2.0, rtol=within)
    np.testing.assert_allclose(np.rad2deg(turn).std(axis=0), 3.0, rtol=within)
    np.testing.assert_allclose(found[:, 7:10].std(axis=0), [0.5, 0.5, 0.1], rtol=within)
    np.testing.assert_allclose(np.rad2deg(found[:, 10:]).std(axis=0), 4.0, rtol=within)


@pytest.mark.parametrize(
    ("block", "named"),
    [
        ({"kind": "measurement_error", "noise": {"velocity": 1.0}}, "velocity"),
        ({"kind": "measurement_error", "noise": {"speed": -1.0}}, "speed"),
        ({"kind": "transmission", "loss": 1.0}, "loss"),
    ],
)
def test_wrong_settings_are_refused_by_name(block: dict[str, Any], named: str) -> None:
    with pytest.raises(ParameterError, match=named):
        of_cart(block)
