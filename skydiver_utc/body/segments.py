# SPDX-License-Identifier: Apache-2.0
"""The 16 segments of the body and the 15 joints that hold them together.

Zero pose: standing upright, arms at the sides, palms to the thighs, feet at right angles to the shanks.
In the zero pose every segment's axes are those of the body: x to the head, y to the left, z dorsal.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from skydiver_utc.arrays import Array, Integers
from skydiver_utc.errors import ParameterError
from skydiver_utc.parameters.body import SegmentTable, Subject


class Segment(NamedTuple):
    """A segment's place in the tree and its kind in the tables."""

    name: str
    kind: str
    parent: str
    side: int
    joint: str


# Parents stand before their children. Side: 1 left, -1 right, 0 on the midline.
SEGMENTS: tuple[Segment, ...] = (
    Segment("lower_trunk", "lower_trunk", "", 0, ""),
    Segment("mid_trunk", "mid_trunk", "lower_trunk", 0, "lumbar"),
    Segment("upper_trunk", "upper_trunk", "mid_trunk", 0, "thorax"),
    Segment("head", "head", "upper_trunk", 0, "neck"),
    Segment("left_upper_arm", "upper_arm", "upper_trunk", 1, "left_shoulder"),
    Segment("right_upper_arm", "upper_arm", "upper_trunk", -1, "right_shoulder"),
    Segment("left_forearm", "forearm", "left_upper_arm", 1, "left_elbow"),
    Segment("right_forearm", "forearm", "right_upper_arm", -1, "right_elbow"),
    Segment("left_hand", "hand", "left_forearm", 1, "left_wrist"),
    Segment("right_hand", "hand", "right_forearm", -1, "right_wrist"),
    Segment("left_thigh", "thigh", "lower_trunk", 1, "left_hip"),
    Segment("right_thigh", "thigh", "lower_trunk", -1, "right_hip"),
    Segment("left_shank", "shank", "left_thigh", 1, "left_knee"),
    Segment("right_shank", "shank", "right_thigh", -1, "right_knee"),
    Segment("left_foot", "foot", "left_shank", 1, "left_ankle"),
    Segment("right_foot", "foot", "right_shank", -1, "right_ankle"),
)
JOINTS: tuple[str, ...] = tuple(s.joint for s in SEGMENTS[1:])
KINDS: tuple[str, ...] = tuple(dict.fromkeys(s.kind for s in SEGMENTS))
_INDEX = {segment.name: i for i, segment in enumerate(SEGMENTS)}


def carriers(segment: Segment) -> list[Segment]:
    """A segment and all between it and the root."""
    parent = _INDEX.get(segment.parent)
    return [segment] if parent is None else [segment, *carriers(SEGMENTS[parent])]


# Direction from the proximal to the distal end in the segment's own axes; trunk and head count from the hip.
_UP, _DOWN, _VENTRAL = np.array([1.0, 0.0, 0.0]), np.array([-1.0, 0.0, 0.0]), np.array([0.0, 0.0, -1.0])
_DISTAL = (
    dict.fromkeys(("lower_trunk", "mid_trunk", "upper_trunk", "head"), _UP)
    | dict.fromkeys(("upper_arm", "forearm", "hand", "thigh", "shank"), _DOWN)
    | {"foot": _VENTRAL}
)
# The ankle sits over the foot this share of its length from the heel.
_ANKLE_FROM_HEEL = 0.25


class Body(NamedTuple):
    """A subject's body; arrays run over the segments in the order of `SEGMENTS`.

    parent (16,) index of the parent, -1 for the root
    joint (16, 3) joint centre in the parent's axes from the parent's proximal joint [m]
    centre (16, 3) centre of mass in the segment's axes from its own proximal joint [m]
    mass (16,) [kg]; inertia (16, 3) principal moments about the segment's own x, y, z [kg m2]
    drag_area (16, 3) along the segment's own x, y, z [m2]
    """

    parent: Integers
    joint: Array
    centre: Array
    mass: Array
    inertia: Array
    drag_area: Array

    @property
    def total_mass(self) -> float:
        """Mass of the whole body [kg]."""
        return float(self.mass.sum())


def build_body(subject: Subject) -> Body:
    """The body of a subject: lengths scale with height, masses with mass, drag areas with both."""
    table = subject.segments
    _check_kinds(table.segments, "segment table", table.name)
    _check_kinds(subject.suit.drag_areas_m2, "suit", subject.suit.name)
    lengths = {kind: _scaled_mm(data.length_mm, subject) for kind, data in table.segments.items()}
    rows = [_segment_rows(segment, subject, lengths) for segment in SEGMENTS]
    centre, mass, inertia, drag_area = map(np.array, zip(*rows, strict=True))
    parent = np.array([_INDEX.get(segment.parent, -1) for segment in SEGMENTS])
    joint = np.array([_joint_position(segment, subject, lengths) for segment in SEGMENTS])
    return Body(parent, joint, centre, mass, inertia, drag_area)


def ellipsoids(body: Body) -> Array:
    """Half axes (16, 3) [m] of the solid ellipsoids with the segments' masses and moments of inertia.

    A solid ellipsoid has I_x = m (b^2 + c^2) / 5.
    """
    return np.sqrt(2.5 * (body.inertia.sum(axis=1, keepdims=True) - 2.0 * body.inertia) / body.mass[:, None])


def _check_kinds(given: Mapping[str, object], what: str, name: str) -> None:
    wrong = set(KINDS) ^ set(given)
    if wrong:
        raise ParameterError(f"{what} {name} must name exactly {', '.join(KINDS)}: look at {sorted(wrong)}")


def _scaled_mm(length_mm: float, subject: Subject) -> float:
    return length_mm * 1e-3 * subject.height_m / subject.segments.reference_height_m


def _segment_rows(
    segment: Segment, subject: Subject, lengths: dict[str, float]
) -> tuple[Array, float, Array, Array]:
    """Centre of mass, mass, principal moments and drag areas of one segment."""
    data = subject.segments.segments[segment.kind]
    shares = sum(subject.segments.segments[other.kind].mass_fraction for other in SEGMENTS)
    mass = subject.mass_kg * data.mass_fraction / shares
    length = lengths[segment.kind]
    distal = _DISTAL[segment.kind]
    from_proximal = data.centre_fraction * length
    if distal is _UP:
        from_proximal = length - from_proximal
    if distal is _VENTRAL:
        from_proximal -= _ANKLE_FROM_HEEL * length
    centre = distal * from_proximal
    long, ml, ap = (
        mass * (length * g) ** 2 for g in (data.gyration_long, data.gyration_ml, data.gyration_ap)
    )
    suit = subject.suit
    scale = area_ratio(subject, suit.reference_mass_kg, suit.reference_height_m)
    front, side, axial = (area * scale for area in suit.drag_areas_m2[segment.kind])
    if distal is _VENTRAL:
        return centre, mass, np.array([ap, ml, long]), np.array([front, side, axial])
    return centre, mass, np.array([long, ml, ap]), np.array([axial, side, front])


def area_ratio(subject: Subject, mass_kg: float, height_m: float) -> float:
    """A subject's areas over those of a body of another mass and height.

    Areas grow with length times breadth, breadth with the root of mass per length.
    """
    length = subject.height_m / height_m
    return length * math.sqrt(subject.mass_kg / mass_kg / length)


def _joint_position(segment: Segment, subject: Subject, lengths: dict[str, float]) -> Array:
    """Joint centre in the parent's axes, from the parent's proximal joint; the root's is mid hip."""
    table: SegmentTable = subject.segments
    if segment.parent == "":
        return np.zeros(3)
    if segment.kind == "thigh":
        return np.array([0.0, segment.side * _scaled_mm(table.hip_offset_mm, subject), 0.0])
    if segment.kind == "upper_arm":
        below = _scaled_mm(table.shoulder_to_hip_mm, subject) - lengths["lower_trunk"] - lengths["mid_trunk"]
        return np.array([below, segment.side * _scaled_mm(table.shoulder_offset_mm, subject), 0.0])
    parent_kind = SEGMENTS[_INDEX[segment.parent]].kind
    return _DISTAL[parent_kind] * lengths[parent_kind]
