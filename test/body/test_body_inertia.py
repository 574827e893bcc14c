# SPDX-License-Identifier: Apache-2.0
"""Whole-body inertia against an independent model: Yeadon's stadium solids, measured on the same subjects.

The package `yeadon` builds each subject from 95 tape measurements. Ours is built from mass and height alone, and
once more as the same subject: with a segment table of his own that holds the lengths and masses of his segments.
Subjects and their licence: test/data/yeadon/.
"""

import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from skydiver_utc.body.posture import configuration
from skydiver_utc.body.segments import JOINTS, build_body
from skydiver_utc.parameters import load_scenario
from skydiver_utc.parameters.yaml_io import write_yaml

yeadon = pytest.importorskip("yeadon")

DATA = Path(__file__).parents[1] / "data" / "yeadon"
SUBJECT = load_scenario("bank_recovery").plant.subject
SUBJECTS = ("male1", "male2", "male3")
# Joint angles in degrees, both sides alike; Yeadon's foot always points along the shank, so ours does too.
POSTURES = {
    "standing": {},
    "spread_eagle": {"shoulder": (0, 90, 0), "hip": (0, 25, 0)},
    "box": {"shoulder": (0, 90, -90), "elbow": (90, 0, 0), "hip": (0, 20, 0), "knee": (45, 0, 0)},
}
# The bars: shares of Yeadon's moment; off-diagonals as a share of his largest moment.
BARS = {"mediolateral": 0.05, "anteroposterior": 0.05, "longitudinal": 0.10, "off_diagonal": 0.05}


def theirs(human, posture):
    """Yeadon's inertia (3, 3) about the centre of mass, turned into x to the head, y to the left, z dorsal."""
    shoulder, hip = posture.get("shoulder", (0, 0, 0)), posture.get("hip", (0, 0, 0))
    elbow, knee = posture.get("elbow", (0, 0, 0))[0], posture.get("knee", (0, 0, 0))[0]
    for joint, degrees in {
        "CA1adduction": -shoulder[1],
        "CB1abduction": shoulder[1],
        "CA1rotation": -shoulder[2],
        "CB1rotation": shoulder[2],
        "A1A2extension": -elbow,
        "B1B2extension": -elbow,
        "PJ1adduction": -hip[1],
        "PK1abduction": hip[1],
        "J1J2flexion": knee,
        "K1K2flexion": knee,
    }.items():
        human.set_CFG(joint, math.radians(degrees))
    # His axes: x to the left, y dorsal, z to the head.
    turn = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    return turn @ np.asarray(human.inertia) @ turn.T


def stature(human):
    """Vertex to sole [m]: trunk and head, leg to the ankle, ankle to heel."""
    m = human.meas
    leg = (m["Lj5L"] + m["Lk5L"] + m["Lj6L"] + m["Lk6L"]) / 2
    return float(m["Ls5L"] + m["Ls8L"] + leg)


# Yeadon's solids of our limbs, both cut at the joints: by his segment and the places of the solids in it.
LIMBS = {
    "upper_arm": ("A1", (0, 1)),
    "forearm": ("A2", (0, 1)),
    "hand": ("A2", (2, 3, 4)),
    "thigh": ("J1", (0, 1, 2)),
    "shank": ("J2", (0, 1)),
    "foot": ("J2", (2, 3, 4, 5)),
}
TRUNK = ("lower_trunk", "mid_trunk", "upper_trunk", "head")


def mass_up_to(solid, share):
    """Mass [kg] of the lower `share` of a solid's height: a stadium solid, or the half ellipsoid of the skull."""
    if not hasattr(solid, "stads"):
        return float(solid.mass) * (1.5 * share - 0.5 * share**3)
    (low, high), u = solid.stads, np.linspace(0.0, share, 3)
    radius = low.radius + u * (high.radius - low.radius)
    thickness = low.thickness + u * (high.thickness - low.thickness)
    area = 4.0 * radius * thickness + np.pi * radius**2
    # Simpson's rule, exact for a quadratic.
    return float(solid.density * solid.height * share * (area[0] + 4.0 * area[1] + area[2]) / 6.0)


def own_table(human):
    """A segment table with the lengths and masses of this man's segments, and de Leva's shapes and end points.

    Limbs as he is measured. Trunk and head share the measured length from hip to vertex in de Leva's proportions;
    the mass of each is that of Yeadon's solids between its ends.
    """
    table, height = SUBJECT.segments, stature(human)
    parts = {segment.label.partition(":")[0]: segment.solids for segment in human.segments}
    measured = {}
    for kind, (label, places) in LIMBS.items():
        solids = [parts[label][i] for i in places]
        measured[kind] = sum(float(s.height) for s in solids), sum(float(s.mass) for s in solids)
    column = [solid for label in ("P", "T", "C") for solid in parts[label]]
    total = float(human.meas["Ls5L"] + human.meas["Ls8L"])
    shares = np.cumsum([0.0] + [table.segments[kind].length_mm for kind in TRUNK])
    levels = total * shares / shares[-1]

    def mass_below(level):
        mass = bottom = 0.0
        for solid in column:
            mass += mass_up_to(solid, np.clip((level - bottom) / float(solid.height), 0.0, 1.0))
            bottom += float(solid.height)
        return mass

    for kind, low, high in zip(TRUNK, levels[:-1], levels[1:], strict=True):
        measured[kind] = high - low, mass_below(high) - mass_below(low)
    segments = {
        kind: table.segments[kind].replace(
            length_mm=float(1e3 * length), mass_fraction=float(mass / human.mass)
        )
        for kind, (length, mass) in measured.items()
    }
    scale = height / table.reference_height_m
    return table.replace(
        segments=segments,
        reference_height_m=height,
        shoulder_to_hip_mm=1e3 * float(human.meas["Ls4L"]),
        shoulder_offset_mm=scale * table.shoulder_offset_mm,
        hip_offset_mm=scale * table.hip_offset_mm,
    )


@cache
def differences(subject, posture, same_subject=False):
    """Ours against theirs, by the names of `BARS`."""
    human = yeadon.Human(str(DATA / f"{subject}.txt"))
    segments = own_table(human) if same_subject else SUBJECT.segments
    body = build_body(SUBJECT.replace(mass_kg=float(human.mass), height_m=stature(human), segments=segments))
    angles = np.zeros((15, 3))
    for joint, degrees in {**POSTURES[posture], "ankle": (-90, 0, 0)}.items():
        for side in ("left", "right"):
            angles[JOINTS.index(f"{side}_{joint}")] = np.deg2rad(degrees)
    ours, oracle = configuration(body, angles).inertia, theirs(human, POSTURES[posture])
    off_diagonal = (ours - oracle)[np.triu_indices(3, 1)] / oracle.max()
    return {
        "mediolateral": ours[1, 1] / oracle[1, 1] - 1,
        "anteroposterior": ours[2, 2] / oracle[2, 2] - 1,
        "longitudinal": ours[0, 0] / oracle[0, 0] - 1,
        "off_diagonal": float(np.abs(off_diagonal).max()),
    }


@pytest.mark.parametrize("subject", SUBJECTS)
@pytest.mark.parametrize("posture", POSTURES)
def test_every_moment_of_a_measured_man_is_within_its_bar(subject, posture):
    found = differences(subject, posture, same_subject=True)
    assert all(abs(found[axis]) <= bar for axis, bar in BARS.items())


@pytest.mark.parametrize(
    ("subject", "least", "most"), [("male3", 0, 0.071), ("male2", 0, 0.112), ("male1", 0.10, 0.144)]
)
def test_mass_and_height_alone_describe_common_builds_only(subject, least, most):
    for posture in POSTURES:
        *moments, off_diagonal = differences(subject, posture).values()
        assert all(least <= abs(moment) <= most for moment in moments)
        assert off_diagonal <= BARS["off_diagonal"]


def test_a_subject_may_have_a_segment_table_of_its_own(tmp_path):
    """A file that `subject.segments` names; lengths and masses of the body are those in it."""
    human = yeadon.Human(str(DATA / "male1.txt"))
    path = tmp_path / "male1.yaml"
    path.write_text(write_yaml(own_table(human).as_dict()), encoding="utf-8")
    overrides = {
        "plant.subject.segments": str(path),
        "plant.subject.mass_kg": float(human.mass),
        "plant.subject.height_m": stature(human),
    }
    body = build_body(load_scenario("bank_recovery", overrides).plant.subject)
    knee = body.joint[1 + JOINTS.index("left_knee")]
    assert knee[0] == pytest.approx(-float(human.meas["Lj3L"]), rel=1e-9)
    shank = {segment.label[:2]: segment for segment in human.segments}["J2"]
    ours = body.mass[[1 + JOINTS.index("left_knee"), 1 + JOINTS.index("left_ankle")]].sum()
    assert ours == pytest.approx(float(shank.mass), rel=2e-3)


def test_the_oracle_is_the_model_that_it_claims_to_be():
    """Figures of male3 worked out apart from this file: 80.15 kg; the box and standing, kg m2."""
    human = yeadon.Human(str(DATA / "male3.txt"))
    assert human.mass == pytest.approx(80.15, abs=0.01)
    box, standing = theirs(human, POSTURES["box"]), theirs(human, POSTURES["standing"])
    np.testing.assert_allclose(np.diag(box), [3.83, 14.06, 16.52], atol=0.006)
    assert abs(box[0, 2]) == pytest.approx(1.24, abs=0.006)
    np.testing.assert_allclose(np.diag(standing), [0.963, 13.95, 14.57], atol=0.006)
