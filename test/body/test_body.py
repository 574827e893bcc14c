# SPDX-License-Identifier: Apache-2.0
"""Segments, joints and postures: algebra that holds for any body, and the sense of each rotation."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skydiver_utc.body.posture import configuration, posture_angles
from skydiver_utc.body.segments import JOINTS, SEGMENTS, build_body
from skydiver_utc.parameters import ParameterError, Posture, load_scenario

SCENARIO = load_scenario("fast_turn_unknown_dynamics")
BODY = build_body(SCENARIO.plant.subject)
INDEX = {segment.name: i for i, segment in enumerate(SEGMENTS)}


def placed(**degrees):
    angles = np.zeros((15, 3))
    for joint, values in degrees.items():
        angles[JOINTS.index(joint)] = np.deg2rad(values)
    return configuration(BODY, angles)


def test_mass_and_standing_height_are_the_subject_s():
    """Vertex to sole in the zero pose: the published lengths tile the body to within 4 %."""
    assert BODY.total_mass == pytest.approx(SCENARIO.plant.subject.mass_kg, rel=1e-12)
    standing = placed()
    lengths = SCENARIO.plant.subject.segments.segments
    scale = SCENARIO.plant.subject.height_m / SCENARIO.plant.subject.segments.reference_height_m
    vertex = standing.proximal[INDEX["head"], 0] + scale * lengths["head"].length_mm / 1000
    ankle = standing.proximal[INDEX["left_foot"], 0]
    # The ankle joint lies some 7 cm above the sole.
    assert vertex - ankle + 0.07 == pytest.approx(SCENARIO.plant.subject.height_m, rel=0.04)


@pytest.mark.parametrize("seed", range(5))
def test_inertia_and_centre_of_mass_from_first_principles(seed):
    """Parallel axes summed in a loop with SciPy's rotations, apart from the code."""
    angles = np.random.default_rng(seed).normal(0, 0.6, (15, 3))
    result = configuration(BODY, angles)
    inertia, weighted = np.zeros((3, 3)), np.zeros(3)
    for i in range(16):
        r, R = result.centre[i], result.rotation[i]
        inertia += R @ np.diag(BODY.inertia[i]) @ R.T + BODY.mass[i] * ((r @ r) * np.eye(3) - np.outer(r, r))
        weighted += BODY.mass[i] * r
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(weighted, 0.0, atol=1e-12)
    np.testing.assert_allclose(result.inertia, inertia, rtol=1e-12)


def test_joint_rotation_is_intrinsic_yzx():
    hip = np.deg2rad([30.0, 20.0, 10.0])
    result = placed(left_hip=[30.0, 20.0, 10.0])
    expected = Rotation.from_euler("YZX", [-hip[0], -hip[1], -hip[2]]).as_matrix()
    np.testing.assert_allclose(result.rotation[INDEX["left_thigh"]], expected, atol=1e-14)


@pytest.mark.parametrize(
    ("joint", "degrees", "segment", "axis", "sign"),
    [
        ("left_hip", [30, 0, 0], "left_thigh", 2, -1),
        ("right_hip", [30, 0, 0], "right_thigh", 2, -1),
        ("left_knee", [30, 0, 0], "left_shank", 2, 1),
        ("left_elbow", [30, 0, 0], "left_forearm", 2, -1),
        ("left_shoulder", [0, 30, 0], "left_upper_arm", 1, 1),
        ("right_shoulder", [0, 30, 0], "right_upper_arm", 1, -1),
        ("thorax", [0, 30, 0], "upper_trunk", 1, 1),
        ("lumbar", [30, 0, 0], "mid_trunk", 2, -1),
    ],
)
def test_positive_directions(joint, degrees, segment, axis, sign):
    """Flexion ventral (knee dorsal), abduction away from the midline, trunk bends forward and to the left."""
    i = INDEX[segment]
    moved, still = placed(**{joint: degrees}), placed()
    change = (moved.centre[i] - moved.proximal[i]) - (still.centre[i] - still.proximal[i])
    assert np.sign(change[axis]) == sign


def test_unknown_joint_is_named():
    posture = Posture(name="p", description="", source="", joint_angles_deg={"left_toe": (0.0, 0.0, 0.0)})
    with pytest.raises(ParameterError, match="left_toe"):
        posture_angles(posture)
