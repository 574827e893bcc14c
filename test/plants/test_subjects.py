# SPDX-License-Identifier: Apache-2.0
"""Subjects and suits: each falls straight in its neutral posture, and the commands of the files make them again."""

import numpy as np
import pytest
from command_line import invoke
from scipy.optimize import brentq
from skydivers import falling_straight, oracle_derivative, skydiver

from skydiver_utc.parameters.loading import config_folder
from skydiver_utc.parameters.yaml_io import read_yaml

# Posture by segment table and suit: a body scaled as a whole balances in the same posture.
ATHLETES = {
    ("average", "formation"): "neutral",
    ("average", "standard"): "neutral_standard",
    ("heavy", "formation"): "neutral",
    ("heavy", "standard"): "neutral_standard",
    ("light", "formation"): "neutral_female",
    ("light", "standard"): "neutral_female_standard",
}
SUBJECTS = ATHLETES | {("paper", "paper"): "neutral_paper"}
# Skydiver, files of his neutral posture and of his turn.
SKYDIVERS = {"athlete": ("neutral", "turn"), "paper": ("neutral_paper", "turn_paper")}


def scenario_of(subject, suit, posture=None):
    of = {"skydiver": "paper"} if subject == "paper" else {"subject": subject, "subject__suit": suit}
    return skydiver(posture=posture or SUBJECTS[subject, suit], **of)


def by_the_oracle(scenario, alpha=0.0):
    """Accelerations (6,) in body axes as a function of the speed [m/s], by the oracle's equations of motion."""
    derivative = oracle_derivative(scenario, np.array([0.0, 0.0, 0.0, alpha]))
    return lambda speed: derivative(falling_straight(scenario, speed))[7:]


def terminal_speed(accelerations):
    """Where drag along the dorsal axis carries the weight [m/s]."""
    return brentq(lambda speed: accelerations(speed)[2], 30, 90, xtol=1e-12)


@pytest.mark.parametrize(("subject", "suit"), SUBJECTS)
def test_every_subject_falls_straight_in_its_neutral_posture(subject, suit):
    """No acceleration above 1e-6 m/s2 or rad/s2 at the one speed where drag carries the weight."""
    accelerations = by_the_oracle(scenario_of(subject, suit))
    speed = terminal_speed(accelerations)
    assert np.abs(accelerations(speed)).max() < 1e-6
    assert 50 < speed < 65


def test_the_wider_suit_falls_slower_and_turns_faster():
    speed, turn = {}, {}
    for subject, suit in ATHLETES:
        scenario = scenario_of(subject, suit)
        speed[subject, suit] = terminal_speed(by_the_oracle(scenario))
        turn[subject, suit] = by_the_oracle(scenario, scenario.plant.limits.alpha[1])(speed[subject, suit])[5]
    for subject in ("light", "average", "heavy"):
        assert speed[subject, "formation"] < speed[subject, "standard"] - 1
        assert turn[subject, "formation"] > turn[subject, "standard"] + 1
    for suit in ("formation", "standard"):
        assert speed["light", suit] < speed["average", suit] < speed["heavy", suit]


@pytest.mark.parametrize("name", SKYDIVERS)
def test_a_skydiver_is_one_choice_and_falls_straight_from_the_start(name):
    """All his files, and a speed and pitch at which nothing accelerates by more than the rounding of both."""
    plant = skydiver(skydiver=name).plant
    assert (plant.posture.name, plant.pattern.name) == SKYDIVERS[name]
    accelerations = by_the_oracle(skydiver(skydiver=name))(plant.initial.fall_speed_m_s)
    assert np.abs(accelerations).max() < 0.02


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("neutral", ["skydiver=athlete"]),
        ("neutral_paper", ["skydiver=paper"]),
        pytest.param("neutral_standard", ["subject.suit=standard"], marks=pytest.mark.long),
        pytest.param("neutral_female", ["subject=light"], marks=pytest.mark.long),
        pytest.param(
            "neutral_female_standard", ["subject=light", "subject.suit=standard"], marks=pytest.mark.long
        ),
    ],
)
def test_a_neutral_posture_is_made_again_by_its_command(name, settings, tmp_path):
    """From the box; all but the name, which is that of the file."""
    path = tmp_path / f"{name}.yaml"
    of = [f"--set=plant.{setting}" for setting in [*settings, "posture=box"]]
    assert invoke("pattern", "neutral", "bank_recovery", *of, "--out", str(path)).exit_code == 0
    made, committed = read_yaml(path), read_yaml(config_folder() / "postures" / path.name)
    made_angles, angles = made.pop("joint_angles_deg"), committed.pop("joint_angles_deg")
    assert made == committed
    for joint, degrees in angles.items():
        np.testing.assert_allclose(made_angles[joint], degrees, atol=1e-4)
        np.testing.assert_array_equal(made_angles[joint], np.round(made_angles[joint], 9))


def test_a_file_that_cannot_be_written_is_refused(tmp_path):
    arguments = ["pattern", "neutral", "bank_recovery", "--out", str(tmp_path / "posture.txt")]
    result = invoke(*arguments)
    assert result.exit_code == 2
    assert ".yaml" in result.stderr
