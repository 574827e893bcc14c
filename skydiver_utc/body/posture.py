# SPDX-License-Identifier: Apache-2.0
"""From joint angles to where each segment is, and the inertia of the whole.

Joint rotations are intrinsic: flexion about the mediolateral axis, then abduction about the
anteroposterior axis, then internal rotation about the long axis, each in the turned axes (the order of
the ISB recommendation for hip, knee, ankle and elbow; used for the shoulder too, because the ISB shoulder
sequence is singular at the zero pose).
Positive: flexion moves the distal end ventrally (knee: dorsally; trunk and neck: bend forward),
abduction moves it away from the midline, internal rotation turns its ventral face to the midline.
On the midline abduction is a bend to the left and rotation a turn to the left.
"""

from dataclasses import dataclass

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.body.segments import JOINTS, SEGMENTS, Body
from skydiver_utc.jit import kernel
from skydiver_utc.parameters import JointLimits, MovementPattern, ParameterError, Posture

ANGLES = ("flexion", "abduction", "rotation")
# Angles are written to YAML in degrees with six decimals: one at its limit may pass it by half the last.
_ROUNDING_RAD = 1e-7


def _rotation_signs() -> Array:
    """Signs (15, 3) that turn flexion, abduction, rotation into angles about the body's y, z, x."""
    signs = []
    for segment in SEGMENTS[1:]:
        if segment.side == 0:
            signs.append((1.0, 1.0, 1.0))
        else:
            flexion = 1.0 if segment.kind == "shank" else -1.0
            signs.append((flexion, -segment.side, -segment.side))
    return np.array(signs)


_SIGNS = _rotation_signs()


def rotation_axes() -> Array:
    """Axes (15, 3, 3) about which flexion, abduction and rotation turn a segment, each in the axes turned so far."""
    return _SIGNS[:, :, None] * np.eye(3)[[1, 2, 0]] + 0.0


@dataclass(frozen=True, eq=False)
class Configuration:
    """A body in a posture, in the body frame (pelvis axes, origin at the centre of mass).

    centre (16, 3) centres of mass of the segments [m]; rotation (16, 3, 3) segment to body;
    inertia (3, 3) about the centre of mass [kg m2]; proximal (16, 3) proximal joints [m];
    centre_of_mass (3,) from mid hip in pelvis axes [m].
    """

    centre: Array
    rotation: Array
    inertia: Array
    proximal: Array
    centre_of_mass: Array


def posture_angles(posture: Posture) -> Array:
    """Joint angles (15, 3) in rad of a posture, in the order of `JOINTS`."""
    return np.deg2rad(_joint_rows(posture.joint_angles_deg, f"posture {posture.name}"))


def pattern_direction(pattern: MovementPattern) -> Array:
    """Unit direction (15, 3) of a movement pattern, in the order of `JOINTS`."""
    return _joint_rows(pattern.components, f"pattern {pattern.name}")


def joint_rows(values: Array) -> dict[str, tuple[float, float, float]]:
    """Values (15, 3) by joint, without joints that are at zero: the content of a posture or pattern file."""
    rows = {joint: tuple(map(float, row + 0.0)) for joint, row in zip(JOINTS, values, strict=True)}
    return {joint: (row[0], row[1], row[2]) for joint, row in rows.items() if any(row)}


def joint_ranges(limits: JointLimits) -> tuple[Array, Array]:
    """Smallest and largest joint angles, (15, 3) each, in rad, in the order of `JOINTS`."""
    kinds = [joint.removeprefix("left_").removeprefix("right_") for joint in JOINTS]
    wrong = set(kinds) ^ set(limits.ranges_deg)
    if wrong:
        known = ", ".join(dict.fromkeys(kinds))
        raise ParameterError(f"joint limits {limits.name} must name exactly {known}: look at {sorted(wrong)}")
    ranges = [[getattr(limits.ranges_deg[kind], angle) for angle in ANGLES] for kind in kinds]
    lower, upper = np.deg2rad(np.array(ranges, dtype=float)).transpose(2, 0, 1)
    return lower, upper


def refuse_beyond(limits: JointLimits, angles: Array, what: str) -> None:
    """Refuse joint angles (15, 3) [rad] that a body cannot take; `what` begins the sentence of `ParameterError`."""
    lower, upper = joint_ranges(limits)
    beyond = np.maximum(lower - angles, angles - upper)
    row, column = divmod(int(beyond.argmax()), len(ANGLES))
    if beyond[row, column] > _ROUNDING_RAD:
        angle, low, high = (float(np.rad2deg(values[row, column])) for values in (angles, lower, upper))
        side, limit = ("below", low) if angle < low else ("above", high)
        raise ParameterError(
            f"{what} is beyond the joint limits {limits.name}: {JOINTS[row]} {ANGLES[column]} of {angle:.1f} deg"
            f" is {side} {limit:.1f} deg; choose another posture, a weaker pattern or a narrower range of alpha"
        )


def joint_angle_names() -> tuple[str, ...]:
    """Names of the 45 joint angles, row by row: left_shoulder_flexion, ..."""
    return tuple(f"{joint}_{angle}" for joint in JOINTS for angle in ANGLES)


def _joint_rows(rows: dict[str, tuple[float, float, float]], what: str) -> Array:
    unknown = sorted(set(rows) - set(JOINTS))
    if unknown:
        raise ParameterError(
            f"{what} names unknown joints {', '.join(unknown)}: choose from {', '.join(JOINTS)}"
        )
    return np.array([rows.get(joint, (0.0, 0.0, 0.0)) for joint in JOINTS])


def configuration(body: Body, angles: Array) -> Configuration:
    """Place the segments for joint angles (15, 3) in rad."""
    n = len(SEGMENTS)
    rotation, inertia, centre_of_mass = np.empty((n, 3, 3)), np.empty((3, 3)), np.empty(3)
    proximal, centre = np.empty((n, 3)), np.empty((n, 3))
    place(body, angles, rotation, proximal, centre, centre_of_mass)
    inertia_of(body, rotation, centre, inertia)
    return Configuration(centre, rotation, inertia, proximal, centre_of_mass)


@kernel
def place(
    body: Body, angles: Array, rotation: Array, proximal: Array, centre: Array, centre_of_mass: Array
) -> None:
    """The arrays of `Configuration` but for the inertia, for joint angles (15, 3) in rad."""
    n, total, own = len(body.mass), 0.0, np.empty((3, 3))
    for j in range(3):
        centre_of_mass[j] = 0.0
    for i in range(n):
        parent = body.parent[i]
        total += body.mass[i]
        if parent >= 0:
            _turn_yzx(angles[i - 1], _SIGNS[i - 1], own)
        for j in range(3):
            proximal[i, j] = 0.0 if parent < 0 else proximal[parent, j]
            for k in range(3):
                rotation[i, j, k] = 1.0 if parent < 0 and j == k else 0.0
                if parent >= 0:
                    proximal[i, j] += rotation[parent, j, k] * body.joint[i, k]
                    for m in range(3):
                        rotation[i, j, k] += rotation[parent, j, m] * own[m, k]
            centre[i, j] = proximal[i, j]
            for k in range(3):
                centre[i, j] += rotation[i, j, k] * body.centre[i, k]
            centre_of_mass[j] += body.mass[i] * centre[i, j]
    for j in range(3):
        centre_of_mass[j] /= total
        for i in range(n):
            centre[i, j] -= centre_of_mass[j]
            proximal[i, j] -= centre_of_mass[j]


@kernel
def inertia_of(body: Body, rotation: Array, centre: Array, out: Array) -> None:
    """Inertia (3, 3) [kg m2] about the centre of mass of segments that are placed."""
    for j in range(3):
        for k in range(3):
            out[j, k] = 0.0
            for i in range(len(body.mass)):
                out[j, k] -= body.mass[i] * centre[i, j] * centre[i, k]
                for m in range(3):
                    out[j, k] += rotation[i, j, m] * body.inertia[i, m] * rotation[i, k, m]
                    if j == k:
                        out[j, k] += body.mass[i] * centre[i, m] * centre[i, m]


@kernel
def limb_momentum(
    body: Body, angles: Array, rates: Array, rotation: Array, proximal: Array, centre: Array, out: Array
) -> None:
    """Angular momentum (3,) [kg m2/s] about the centre of mass, in pelvis axes, of limbs in motion.

    The joint angles (15, 3) [rad], in which the segments are placed, change at the rates (15, 3) [rad/s].
    """
    n = len(body.mass)
    turning, velocity, own, moving = np.zeros((n, 3)), np.zeros((n, 3)), np.empty(3), np.empty(3)
    for j in range(3):
        out[j] = 0.0
    for i in range(1, n):
        parent = body.parent[i]
        y, z = angles[i - 1, 0] * _SIGNS[i - 1, 0], angles[i - 1, 1] * _SIGNS[i - 1, 1]
        rate_z, rate_x = rates[i - 1, 1] * _SIGNS[i - 1, 1], rates[i - 1, 2] * _SIGNS[i - 1, 2]
        own[0] = rate_z * np.sin(y) + rate_x * np.cos(y) * np.cos(z)
        own[1] = rates[i - 1, 0] * _SIGNS[i - 1, 0] + rate_x * np.sin(z)
        own[2] = rate_z * np.cos(y) - rate_x * np.sin(y) * np.cos(z)
        for j in range(3):
            turning[i, j] = turning[parent, j]
            for k in range(3):
                turning[i, j] += rotation[parent, j, k] * own[k]
        for j in range(3):
            # Of the proximal joint, against mid hip, and of the centre of mass.
            k, m = (j + 1) % 3, (j + 2) % 3
            velocity[i, j] = velocity[parent, j] + (
                turning[parent, k] * (proximal[i, m] - proximal[parent, m])
                - turning[parent, m] * (proximal[i, k] - proximal[parent, k])
            )
            moving[j] = velocity[i, j] + (
                turning[i, k] * (centre[i, m] - proximal[i, m])
                - turning[i, m] * (centre[i, k] - proximal[i, k])
            )
        for j in range(3):
            k, m = (j + 1) % 3, (j + 2) % 3
            out[j] += body.mass[i] * (centre[i, k] * moving[m] - centre[i, m] * moving[k])
            for axis in range(3):
                for other in range(3):
                    spin = rotation[i, other, axis] * turning[i, other]
                    out[j] += rotation[i, j, axis] * body.inertia[i, axis] * spin


@kernel
def _turn_yzx(angles: Array, signs: Array, out: Array) -> None:
    """Rotation (3, 3) about y, then the turned z, then the turned x, for angles (3,) in rad with these signs."""
    y, z, x = angles[0] * signs[0], angles[1] * signs[1], angles[2] * signs[2]
    cy, cz, cx = np.cos(y), np.cos(z), np.cos(x)
    sy, sz, sx = np.sin(y), np.sin(z), np.sin(x)
    out[0, 0], out[0, 1], out[0, 2] = cy * cz, sy * sx - cy * sz * cx, cy * sz * sx + sy * cx
    out[1, 0], out[1, 1], out[1, 2] = sz, cz * cx, -cz * sx
    out[2, 0], out[2, 1], out[2, 2] = -sy * cz, sy * sz * cx + cy * sx, cy * cx - sy * sz * sx
