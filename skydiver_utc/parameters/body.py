# SPDX-License-Identifier: Apache-2.0
"""Parameters of the body that falls: segments, suit, ranges of motion, subject, posture, movement pattern."""

import math
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, model_validator
from typing_extensions import Self

from skydiver_utc.parameters.fields import Parameters, quantity

Fraction = Annotated[float, quantity("1", "share of the whole", gt=0, lt=1)]
Millimetres = Annotated[float, quantity("mm", "length at the reference height", gt=0, le=1000)]
Area = Annotated[float, quantity("m2", "drag area (drag coefficient times area)", ge=0, le=1)]
AngleDeg = Annotated[float, quantity("deg", "joint angle", ge=-180, le=180)]
# Wider, and the table of the posture over alpha would lose its tested accuracy.
PatternAngle = Annotated[float, quantity("rad", "pattern angle", ge=-2, le=2)]
Component = Annotated[float, quantity("rad/rad", "joint angle per unit of pattern angle", ge=-1, le=1)]


def rising(pair: tuple[float, float]) -> tuple[float, float]:
    """A lower and an upper bound; ValueError where the upper one is not above the lower one."""
    if not pair[0] < pair[1]:
        raise ValueError(f"the bounds are upside down: write the smaller of {pair[0]}, {pair[1]} first")
    return pair


class SegmentData(Parameters):
    """Inertial parameters of one segment as shares of the body's mass and the segment's length."""

    mass_fraction: Fraction
    length_mm: Millimetres
    centre_fraction: Fraction
    gyration_ap: Fraction
    gyration_ml: Fraction
    gyration_long: Fraction


class _OfReferenceSubject(Parameters):
    name: str
    source: str
    reference_mass_kg: Annotated[float, quantity("kg", "mass of the reference subject", gt=0, le=200)]
    reference_height_m: Annotated[float, quantity("m", "height of the reference subject", gt=0, le=2.5)]


class SegmentTable(_OfReferenceSubject):
    """Segment parameters of a population, for bilateral segments one entry serves both sides."""

    shoulder_to_hip_mm: Millimetres
    shoulder_offset_mm: Annotated[
        float, quantity("mm", "shoulder joint centre from the midline", gt=0, le=400)
    ]
    hip_offset_mm: Annotated[float, quantity("mm", "hip joint centre from the midline", gt=0, le=400)]
    offsets_source: str
    segments: dict[str, SegmentData]


class Suit(_OfReferenceSubject):
    """Drag areas of the dressed segments of a reference subject: front, side and axial."""

    drag_areas_m2: dict[str, tuple[Area, Area, Area]]


class JointRange(Parameters):
    """Smallest and largest angle of one joint in degrees, about each of its three axes."""

    flexion: tuple[AngleDeg, AngleDeg]
    abduction: tuple[AngleDeg, AngleDeg]
    rotation: tuple[AngleDeg, AngleDeg]

    @model_validator(mode="after")
    def _check(self) -> Self:
        for name in ("flexion", "abduction", "rotation"):
            lower, upper = getattr(self, name)
            if lower > upper:
                raise ValueError(
                    f"range of {name} is upside down: write the smaller of {lower}, {upper} first"
                )
        return self


class JointLimits(Parameters):
    """Ranges of motion by kind of joint (shoulder, not left_shoulder): one entry serves both sides."""

    name: str
    source: str
    ranges_deg: dict[str, JointRange]


class Subject(Parameters):
    """A person who falls."""

    name: str
    mass_kg: Annotated[float, quantity("kg", "mass with clothing", ge=30, le=200)]
    height_m: Annotated[float, quantity("m", "body height", ge=1.2, le=2.3)]
    segments: SegmentTable
    suit: Suit
    joint_limits: JointLimits


class Posture(Parameters):
    """Joint angles in degrees: flexion, abduction, internal rotation; a joint left out is at zero."""

    name: str
    description: str = ""
    source: str = ""
    joint_angles_deg: dict[str, tuple[AngleDeg, AngleDeg, AngleDeg]]


class MovementPattern(Parameters):
    """Direction in joint space, of unit norm, that one pattern angle moves along."""

    kind: Literal["direction"] = "direction"

    name: str
    description: str
    source: str
    components: dict[str, tuple[Component, Component, Component]]

    @model_validator(mode="after")
    def _check(self) -> Self:
        norm = sum(c * c for row in self.components.values() for c in row) ** 0.5
        if not math.isclose(norm, 1.0, abs_tol=1e-6):
            raise ValueError(f"the movement pattern {self.name} must have unit norm, it has {norm:.6f}")
        return self


class Keyframe(Parameters):
    """A posture that a path goes through, and the pattern angle at which it does."""

    alpha: PatternAngle
    posture: Posture


class PosturePath(Parameters):
    """Postures in joint space that one pattern angle moves through, in the order of growing alpha."""

    kind: Literal["path"] = "path"

    name: str
    description: str
    source: str
    keyframes: tuple[Keyframe, ...]

    @model_validator(mode="after")
    def _check(self) -> Self:
        alphas = [keyframe.alpha for keyframe in self.keyframes]
        if len(alphas) < 2:
            raise ValueError(f"the path {self.name} has {len(alphas)} keyframes: give at least two")
        if any(after <= before for before, after in pairwise(alphas)):
            raise ValueError(
                f"the keyframes of path {self.name} must be in the order of growing alpha: sort them"
            )
        return self


Pattern = Annotated[MovementPattern | PosturePath, Field(discriminator="kind")]
