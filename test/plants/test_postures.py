# SPDX-License-Identifier: Apache-2.0
"""The posture library: human joint angles; fall rates in the ranges of docs/postures.md and in the right order."""

import re
from functools import cache
from itertools import cycle
from pathlib import Path

import numpy as np
import pytest
import track
from skydivers import joint_angles, model_of, skydiver

from skydiver_utc.body.posture import joint_ranges
from skydiver_utc.body.segments import JOINTS
from skydiver_utc.plants.skydiver.linearise import linearise
from skydiver_utc.plants.skydiver.steady import HeldBody, straight_falls

ROOT = Path(__file__).parents[2]


_PAGE = (ROOT / "docs" / "postures.md").read_text(encoding="utf-8")
_ROW = r"^\| (\w+) \| (\w+) \| ([\w ]+) \| (\d+) - (\d+) \| ([\d.]+) \| ([\d.]+) \| (-?[\d.]+) \|$"
TABLE = {
    name: (suit, falls, float(low), float(high), tuple(map(float, flies)))
    for name, suit, falls, low, high, *flies in re.findall(_ROW, _PAGE, re.MULTILINE)
}


@cache
def model_and_fall(name, suit="formation", subject="average"):
    model = model_of(skydiver(posture=name, subject=subject, subject__suit=suit))
    return model, straight_falls(model)[0]


def fall_rate(name, suit=None):
    return model_and_fall(name, suit or TABLE[name][0])[1].fall_rate


def names_in(folder):
    return sorted(path.stem for path in (ROOT / "config" / folder).glob("*.yaml"))


SUBJECTS = [name for name in names_in("subjects") if name != "paper"]  # which is built as average


@pytest.mark.parametrize(
    ("posture", "subject", "suit"), list(zip(names_in("postures"), cycle(SUBJECTS), cycle(names_in("suits"))))
)
def test_every_posture_subject_and_suit_has_its_straight_fall(posture, subject, suit):
    """Within 1e-6 m/s2 and rad/s2."""
    assert np.abs(model_and_fall(posture, suit, subject)[1].residual).max() < 1e-6


def test_the_table_lists_the_library():
    """All but the box that neutral is trimmed from, and the neutral postures of other subjects and suits."""
    library = names_in("postures")
    assert set(TABLE) == {name for name in library if name != "box" and not name.startswith("neutral_")}


@pytest.mark.parametrize("name", TABLE)
def test_fall_rate_lies_in_its_range(name):
    suit, facing, low, high, flies = TABLE[name]
    model, fall = model_and_fall(name, suit)
    assert fall.facing == facing
    assert low <= fall.fall_rate <= high
    found = (fall.fall_rate, np.rad2deg(fall.glide_angle), np.rad2deg(fall.pitch))
    np.testing.assert_allclose(found, flies, atol=0.1)
    assert np.abs(fall.residual).max() < 1e-6
    eigenvalues = np.linalg.eigvals(linearise(HeldBody(model, np.array([0.5, 0.0, 0.0, 0.0])), fall))
    assert eigenvalues.real.max() < 0


def test_track_falls_slower_than_the_box():
    """Than the box in the track's own suit, which falls as a box does, and than neutral in the formation suit."""
    _, _, low, high, _ = TABLE["neutral"]
    box = fall_rate("box", TABLE["track"][0])
    assert low <= box <= high
    assert fall_rate("track") < min(box, fall_rate("neutral")) - 3


def test_track_glides_headwards_with_straight_legs():
    _, fall = model_and_fall("track", TABLE["track"][0])
    assert fall.glide_direction == "headwards"
    assert 0.7 < np.tan(fall.glide_angle) < 1
    joints = skydiver(posture="track").plant.posture.joint_angles_deg
    assert max(abs(joints["left_knee"][0]), abs(joints["left_hip"][0])) <= 15


def test_track_is_made_again_by_its_benchmark():
    """Both the angles, and the fall that the benchmark works out without the kernels."""
    suit = TABLE["track"][0]
    scenario = skydiver(posture="track", subject__suit=suit)
    angles = np.rad2deg(joint_angles(scenario))
    joints = ["thorax" if joint == "thorax" else f"left_{joint}" for joint, _ in track.FREE]
    committed = [
        angles[JOINTS.index(joint), column] for joint, (_, column) in zip(joints, track.FREE, strict=True)
    ]
    np.testing.assert_array_equal(np.round(track.track_posture()) + 0.0, np.round(committed, 9))
    again, (_, fall) = track.fall(scenario, np.array(committed)), model_and_fall("track", suit)
    assert again.fall_rate == pytest.approx(fall.fall_rate, rel=1e-9)
    assert np.deg2rad(again.glide) == pytest.approx(fall.glide_angle, rel=1e-9)


@pytest.mark.parametrize("name", TABLE)
def test_both_sides_are_alike_and_within_the_joint_limits(name):
    scenario = skydiver(posture=name)
    lower, upper = joint_ranges(scenario.plant.subject.joint_limits)
    angles = joint_angles(scenario)
    assert (angles >= lower - 1e-6).all()
    assert (angles <= upper + 1e-6).all()
    joints = scenario.plant.posture.joint_angles_deg
    for joint, row in joints.items():
        assert joints[joint.replace("left_", "right_")] == row
