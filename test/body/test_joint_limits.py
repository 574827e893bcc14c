# SPDX-License-Identifier: Apache-2.0
"""Ranges of motion: what a body cannot take is refused, with joint, angle and limit by name."""

import math

import numpy as np
import pytest
from refusals import assert_refused
from skydivers import plant_of, skydiver

from skydiver_utc.body.posture import joint_ranges
from skydiver_utc.body.segments import JOINTS


@pytest.mark.parametrize(
    ("joint", "degrees", "words"),
    [
        ("left_knee", [-5, 0, 0], ["left_knee flexion of -5.0 deg", "below 0.0 deg"]),
        ("right_hip", [0, 60, 0], ["right_hip abduction of 60.0 deg", "above 45.0 deg"]),
        ("left_shoulder", [0, 90, -116], ["left_shoulder rotation of -116.0 deg", "below -90.0 deg"]),
        ("neck", [0, 0, 61], ["neck rotation of 61.0 deg", "above 60.0 deg"]),
    ],
)
def test_a_posture_beyond_a_joint_is_refused(joint, degrees, words):
    angles = {f"posture__joint_angles_deg__{joint}": degrees}
    assert_refused(["posture neutral", *words], plant_of, **angles)


def test_a_posture_at_its_limit_is_taken():
    plant_of(posture__joint_angles_deg__neck=[-45.0, 0.0, 60.0])


@pytest.mark.parametrize(("alphas", "words"), [([-1.5, 2.0], "alpha = 2"), ([-2.0, 1.5], "alpha = -2")])
def test_the_pattern_is_checked_at_both_ends_of_alpha(alphas, words):
    assert_refused([words, "pattern turn"], plant_of, limits__alpha=alphas)


def test_a_pattern_that_bends_a_joint_too_far_is_named():
    """At alpha = -1.5 rad, by hand: -45 deg + 85.9 deg at the left ankle is beyond 20 deg."""
    components = {"left_ankle": [-1.0, 0.0, 0.0]}
    of_kick = dict.fromkeys(("description", "source"), "") | {"components": components}
    words = ("pattern kick at alpha = -1.5", "left_ankle flexion of 40.9 deg is above 20.0 deg")
    assert_refused(words, plant_of, pattern={"kind": "direction", "name": "kick", **of_kick})


def test_both_sides_have_the_range_of_their_joint():
    lower, upper = joint_ranges(skydiver().plant.subject.joint_limits)
    for side in ("left", "right"):
        row = JOINTS.index(f"{side}_hip")
        np.testing.assert_allclose(lower[row], np.radians([-30, -30, -45]))
        np.testing.assert_allclose(upper[row], np.radians([120, 45, 45]))
    assert upper[JOINTS.index("lumbar"), 2] == pytest.approx(math.radians(18))


def test_limits_upside_down_and_a_joint_without_limits_are_named():
    assert_refused("flexion", skydiver, subject__joint_limits__ranges_deg__knee__flexion=[135, 0])
    limits = skydiver().plant.subject.joint_limits
    ranges = {kind: row for kind, row in limits.ranges_deg.items() if kind != "knee"}
    assert_refused("'knee'", joint_ranges, limits.replace(ranges_deg=ranges))
