"""The posture library: human joint angles; fall rates in the ranges of docs/postures.md and in the right order."""

import re
from pathlib import Path

import numpy as np
import pytest

from skydiver_utc.body.posture import joint_ranges, posture_angles
from skydiver_utc.parameters import load_scenario
from skydiver_utc.plant.linearise import linearise
from skydiver_utc.plant.model import build_model
from skydiver_utc.plant.steady import HeldBody, straight_falls

ROOT = Path(__file__).parents[1]


def rows():
    text = (ROOT / "docs" / "postures.md").read_text(encoding="utf-8")
    pattern = r"^\| (\w+) \| ([\w ]+) \| (\d+) - (\d+) \| ([\d.]+) \| ([\d.]+) \| (-?[\d.]+) \| (yes|no) \|$"
    return {
        name: (falls, float(low), float(high), tuple(map(float, flies)), held == "yes")
        for name, falls, low, high, *flies, held in re.findall(pattern, text, re.MULTILINE)
    }


TABLE = rows()


def model_and_fall(name):
    model = build_model(load_scenario("bank_recovery", {"posture": name}))
    return model, straight_falls(model)[0]


def test_the_table_lists_the_library():
    """All but the box that neutral is trimmed from, and the neutral postures of other subjects and suits."""
    library = {path.stem for path in (ROOT / "config" / "postures").glob("*.yaml")}
    assert set(TABLE) == {name for name in library if name != "box" and not name.startswith("neutral_")}


@pytest.mark.parametrize("name", TABLE)
def test_fall_rate_lies_in_its_range(name):
    facing, low, high, flies, held = TABLE[name]
    model, fall = model_and_fall(name)
    assert fall.facing == facing
    assert (low <= fall.fall_rate <= high) is held
    told = (fall.fall_rate, np.rad2deg(fall.glide_angle), np.rad2deg(fall.pitch))
    np.testing.assert_allclose(told, flies, atol=0.1)
    assert np.abs(fall.residual).max() < 1e-6
    eigenvalues = np.linalg.eigvals(linearise(HeldBody(model, np.array([0.5, 0.0, 0.0, 0.0])), fall))
    assert eigenvalues.real.max() < 0


def test_order_of_fall_rates():
    rates = [model_and_fall(name)[1].fall_rate for name in ("slow_fall", "neutral", "fast_fall", "head_down")]
    assert rates == sorted(rates)
    assert np.diff(rates).min() > 3


def test_track_glides_headwards():
    _, fall = model_and_fall("track")
    assert fall.glide_direction == "headwards"
    assert 0.4 < np.tan(fall.glide_angle) < 1


@pytest.mark.parametrize("name", TABLE)
def test_joint_angles_are_within_the_subject_s_limits(name):
    scenario = load_scenario("bank_recovery", {"posture": name})
    lower, upper = joint_ranges(scenario.subject.joint_limits)
    angles = posture_angles(scenario.posture)
    assert (angles >= lower - 1e-6).all()
    assert (angles <= upper + 1e-6).all()


@pytest.mark.parametrize("name", TABLE)
def test_left_and_right_are_alike(name):
    joints = load_scenario("bank_recovery", {"posture": name}).posture.joint_angles_deg
    for joint, angles in joints.items():
        assert joints[joint.replace("left_", "right_")] == angles
