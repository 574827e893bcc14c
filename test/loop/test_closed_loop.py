# SPDX-License-Identifier: Apache-2.0
"""Runs in process: the scenarios' figures, and the loop itself."""

from typing import Any

import numpy as np
import pytest
from pinned import PINNED

from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.loop.outcome import Outcome
from skydiver_utc.loop.run import Run
from skydiver_utc.parameters import load_scenario, scenario_names

FAST = "fast_turn_unknown_dynamics"
# Largest RMSE [deg/s] of the paper's figures utc_m0_c2, utc_m1_c2 and utc_m1_c3.
THE_PAPERS_THREE = {
    "fast_turn_unknown_dynamics": 4.0,
    "fast_turn_pi_dynamics": 3.0,
    "fast_turn_pi_dynamics_rate_coupling": 2.0,
}
# Three digits: half a unit of the third one is at most this share.
THREE_DIGITS = 5e-3
# A yaw rate of 1e-13 deg/s more or less at the start moves these over the interval about the pinned value.
# (fast_turn_unknown_dynamics takes one of two courses likewise, RMSE 3.069 or 3.079: the pinned value lies between.)
CHAOTIC = {
    "turn_360_left": {"angle_error_deg": 0.05, "overshoot_deg": 0.04},
    "turn_360_right": {"angle_error_deg": 0.05, "overshoot_deg": 0.04},
    "straight_fall_gyro_accelerometer": {"max_abs_error_deg_s": 0.004, "peak_yaw_rate_deg_s": 0.004},
}
QUICK = ("fast_turn_pi_dynamics", "slow_turn_pose_only", "turn_360_left")


def run_of(name: str, **settings: Any) -> Run:
    """A run with other settings, `__` for a dot."""
    return simulate(load_scenario(name, {key.replace("__", "."): value for key, value in settings.items()}))


def test_every_scenario_is_pinned() -> None:
    assert list(PINNED) == scenario_names()


@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.long) for name in PINNED]
)
def test_the_metrics_of_a_scenario(name: str) -> None:
    found = metrics(run_of(name))
    for key, expected in PINNED[name].items():
        if isinstance(expected, float):
            within = CHAOTIC.get(name, {}).get(key, max(THREE_DIGITS * abs(expected), 1e-9))
            assert found[key] == pytest.approx(expected, rel=0, abs=within), key
        else:
            assert found[key] == expected, key


@pytest.mark.long
def test_coupling_and_horizon_matter_when_the_dynamics_are_unknown() -> None:
    """The paper's qualitative claims: without coupling worse, with five steps worse."""
    best = PINNED[FAST]["rmse_deg_s"]
    assert metrics(run_of(FAST, controller__coupling__signs="none"))["rmse_deg_s"] > 1.5 * best
    assert metrics(run_of(FAST, controller__horizon_steps=5))["rmse_deg_s"] > 5 * best


@pytest.mark.long
@pytest.mark.parametrize(("name", "largest"), list(THE_PAPERS_THREE.items()))
def test_the_paper_s_three_figures_need_the_hands(name: str, largest: float) -> None:
    """RMSE at most 4, 3 and 2 deg/s, inside 5 % by 2 s, and three times worse with hands that have no force."""
    assert PINNED[name]["rmse_deg_s"] <= largest
    assert PINNED[name]["convergence_time_s"] <= 2.0
    assert metrics(run_of(name, plant__hands__K_N=0.0))["rmse_deg_s"] >= 3.0 * PINNED[name]["rmse_deg_s"]


@pytest.mark.long
@pytest.mark.parametrize("name", THE_PAPERS_THREE)
def test_the_athlete_flies_the_same_turns(name: str) -> None:
    """With less than a fifth of the printed hand force, more closely than the paper's skydiver."""
    athlete = run_of(name, plant__skydiver="athlete")
    assert athlete.scenario.plant.hands.K_N <= 18.0
    assert metrics(athlete)["rmse_deg_s"] < PINNED[name]["rmse_deg_s"]


@pytest.mark.parametrize("name", ["bank_recovery", "bank_recovery_paper"])
def test_a_straight_fall_recovers_from_a_bank(name: str) -> None:
    """40 s with the controls at rest after a bank of 20 deg: 53 to 60 m/s, belly to earth, no turn left."""
    run = run_of(name, duration_s=50.0)
    settled = run.states[-round(10 / run.scenario.dt_s) :]
    speed = np.linalg.norm(settled[:, 7:10], axis=1)
    assert speed.min() > 53
    assert speed.max() < 60
    assert np.abs(settled[:, 10:12]).max() < np.deg2rad(0.5)
    assert np.abs(settled[:, 12]).max() < np.deg2rad(0.1)


def test_left_and_right_are_mirror_images() -> None:
    """A turn to the right is the turn to the left in the mirror; rounding grows, so only the first 2 s to 1e-6."""
    left = run_of(FAST, duration_s=2.0)
    right = run_of(FAST, duration_s=2.0, reference__amplitude_deg_s=-400.0)
    np.testing.assert_allclose(left.output("yaw_rate"), -right.output("yaw_rate"), atol=1e-6)
    np.testing.assert_allclose(left.applied[:, 1], right.applied[:, 2], atol=1e-5)


def test_commands_respect_bounds_and_slew_rate() -> None:
    run = run_of(FAST, duration_s=6.0, plant__limbs__reaction=False)
    assert (run.commands >= run.plant.minimum).all()
    assert (run.commands <= run.plant.maximum).all()
    slew = np.abs(np.diff(run.commands[:, 3], prepend=0.0))
    assert slew.max() <= run.plant.rate[3] * run.scenario.dt_s + 1e-15
    # With limbs that follow at once the plant has the same limits, so it applies the command.
    np.testing.assert_array_equal(run.commands, run.applied)


def test_moving_limbs_lag_behind_the_command() -> None:
    """By at most the way to stop from full rate and to reach it again, and one step."""
    run = run_of(FAST, duration_s=6.0)
    lag, rate = np.abs(run.commands[:, 3] - run.applied[:, 3]), run.plant.rate[3]
    largest = rate**2 / run.scenario.plant.limbs.alpha_acceleration + rate * run.scenario.dt_s
    assert 0.0 < lag.max() < largest < 0.2
    np.testing.assert_array_equal(run.commands[:, :3], run.applied[:, :3])


@pytest.mark.parametrize("name", scenario_names())
def test_every_scenario_starts(name: str) -> None:
    run = run_of(name, duration_s=0.1)
    assert run.outcome is Outcome.COMPLETED
    assert len(run.states) == len(run.commands) + 1 == len(run.outputs) == len(run.reference)


def test_a_run_that_leaves_the_model_ends_as_diverged() -> None:
    """One hand spins the body in thin air: the rate passes 200 rad/s."""
    hand = {"plant__hands__K_N": 500.0, "plant__limits__k_left": [0.0, 50.0]}
    pressed = {"kind": "constant", "values": {"k_left": 50.0}}
    slots = {"reference": pressed, "controller": {"kind": "open_loop"}}
    run = run_of("bank_recovery", plant__air__density_kg_m3=1e-3, **hand, **slots)
    assert run.outcome is Outcome.DIVERGED
    assert run.reason


def test_progress_ends_with_all_steps() -> None:
    seen: list[tuple[int, int]] = []
    scenario = load_scenario("bank_recovery", {"duration_s": 1.0})
    simulate(scenario, lambda done, steps: seen.append((done, steps)))
    assert seen[-1] == (239, 239)
    assert seen == sorted(seen)


def test_a_run_since_a_step_is_the_rest_of_it() -> None:
    whole = run_of("slow_turn_pose_only", duration_s=0.4)
    rest = whole.since(30)
    assert rest.states.tolist() == whole.states[30:].tolist()
    assert rest.time_s.tolist() == whole.time_s[30:].tolist()
    assert rest.since(40).states.tolist() == whole.states[40:].tolist()
    assert rest.since(40).first_step == 40
