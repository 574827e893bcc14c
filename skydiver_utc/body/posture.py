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
from numpy.typing import NDArray

from skydiver_utc.body.segments import JOINTS, SEGMENTS, Body
from skydiver_utc.parameters import JointLimits, MovementPattern, ParameterError, Posture

Array = NDArray[np.float64]
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
    joint_rotation = _euler_yzx(angles * _SIGNS)
    rotation = np.empty((16, 3, 3))
    proximal = np.zeros((16, 3))
    rotation[0] = np.eye(3)
    for i in range(1, 16):
        parent = body.parent[i]
        rotation[i] = rotation[parent] @ joint_rotation[i - 1]
        proximal[i] = proximal[parent] + rotation[parent] @ body.joint[i]
    centre = proximal + np.einsum("ijk,ik->ij", rotation, body.centre)
    centre_of_mass = body.mass @ centre / body.mass.sum()
    centre -= centre_of_mass
    proximal -= centre_of_mass
    own = np.einsum("ijk,ik,ilk->jl", rotation, body.inertia, rotation)
    square = np.einsum("i,ij,ij->", body.mass, centre, centre)
    inertia = own + square * np.eye(3) - np.einsum("i,ij,ik->jk", body.mass, centre, centre)
    return Configuration(centre, rotation, inertia, proximal, centre_of_mass)


def motion(body: Body, placed: Configuration, angles: Array, rates: Array) -> tuple[Array, Array]:
    """Velocities (16, 3) [m/s] of the segments against the centre of mass, and their turning (16, 3) [rad/s].

    For joint angles (15, 3) [rad] that change at `rates` (15, 3) [rad/s], in pelvis axes, the pelvis at rest.
    """
    signed, signed_rates = angles * _SIGNS, rates * _SIGNS
    turning, joint_velocity = np.zeros((16, 3)), np.zeros((16, 3))
    for i in range(1, 16):
        parent = body.parent[i]
        (about_y, about_z, _), (rate_y, rate_z, rate_x) = signed[i - 1], signed_rates[i - 1]
        cy, sy, cz, sz = np.cos(about_y), np.sin(about_y), np.cos(about_z), np.sin(about_z)
        axis_z, axis_x = np.array([sy, 0.0, cy]), np.array([cy * cz, sz, -sy * cz])
        own = np.array([0.0, rate_y, 0.0]) + rate_z * axis_z + rate_x * axis_x
        turning[i] = turning[parent] + placed.rotation[parent] @ own
        arm = placed.proximal[i] - placed.proximal[parent]
        joint_velocity[i] = joint_velocity[parent] + np.cross(turning[parent], arm)
    velocity = joint_velocity + np.cross(turning, placed.centre - placed.proximal)
    return velocity - body.mass @ velocity / body.mass.sum(), turning


def _euler_yzx(angles: Array) -> Array:
    """Rotations (n, 3, 3) about y, then the turned z, then the turned x, for angles (n, 3) in rad."""
    (cy, cz, cx), (sy, sz, sx) = np.cos(angles).T, np.sin(angles).T
    return np.stack(
        [
            np.stack([cy * cz, sy * sx - cy * sz * cx, cy * sz * sx + sy * cx], -1),
            np.stack([sz, cz * cx, -cz * sx], -1),
            np.stack([-sy * cz, sy * sz * cx + cy * sx, cy * cx - sy * sz * sx], -1),
        ],
        -2,
    )
