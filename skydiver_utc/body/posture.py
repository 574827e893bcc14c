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
from skydiver_utc.body.segments import JOINTS, SEGMENTS, Body, Segment, carriers
from skydiver_utc.errors import ParameterError
from skydiver_utc.parameters.body import JointLimits, MovementPattern, Posture

ANGLES = ("flexion", "abduction", "rotation")
# Angles are written to YAML in degrees with six decimals: one at its limit may pass it by half the last.
_ROUNDING_RAD = 1e-7


def _signs(segment: Segment) -> tuple[float, float, float]:
    """Signs that turn flexion, abduction, rotation into angles about the body's y, z, x."""
    if segment.side == 0:
        return 1.0, 1.0, 1.0
    return 1.0 if segment.kind == "shank" else -1.0, -segment.side, -segment.side


_SIGNS = np.array([_signs(segment) for segment in SEGMENTS[1:]])
# Row by row 1 for a segment and all that carry it, else 0: a product with it sums along the way from the root.
_ON_THE_WAY = np.array([[float(other in carriers(segment)) for other in SEGMENTS] for segment in SEGMENTS])


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
    """Place the segments for joint angles (..., 15, 3) in rad."""
    turns = _turn_yzx(angles * _SIGNS)
    rotation = np.zeros((*angles.shape[:-2], len(SEGMENTS), 3, 3))
    rotation[..., 0, :, :] = np.eye(3)
    for i, parent in enumerate(body.parent[1:], 1):
        rotation[..., i, :, :] = rotation[..., parent, :, :] @ turns[..., i - 1, :, :]
    # The root's own joint is mid hip.
    proximal = _ON_THE_WAY @ _turned(rotation[..., body.parent, :, :], body.joint)
    centre = proximal + _turned(rotation, body.centre)
    centre_of_mass = body.mass @ centre / body.total_mass
    centre -= centre_of_mass[..., np.newaxis, :]
    proximal -= centre_of_mass[..., np.newaxis, :]
    shares = np.swapaxes(centre, -1, -2) @ (body.mass[:, np.newaxis] * centre)
    inertia = in_body_axes(rotation, body.inertia).sum(axis=-3) - shares
    inertia += np.trace(shares, axis1=-2, axis2=-1)[..., np.newaxis, np.newaxis] * np.eye(3)
    return Configuration(centre, rotation, inertia, proximal, centre_of_mass)


def in_body_axes(rotation: Array, principal: Array) -> Array:
    """Matrices (..., 16, 3, 3) in body axes of the segments' principal values (16, 3) in their own axes."""
    turned: Array = (rotation * principal[:, np.newaxis, :]) @ np.swapaxes(rotation, -1, -2)
    return turned


def limb_momentum(body: Body, angles: Array, rates: Array, placed: Configuration) -> Array:
    """Angular momentum (..., 3) [kg m2/s] about the centre of mass, in pelvis axes, of limbs in motion.

    The joint angles (..., 15, 3) [rad], in which the segments are placed, change at the rates (..., 15, 3) [rad/s].
    """
    y, z, _ = np.moveaxis(angles * _SIGNS, -1, 0)
    rate_y, rate_z, rate_x = np.moveaxis(rates * _SIGNS, -1, 0)
    own = np.stack(
        (
            rate_z * np.sin(y) + rate_x * np.cos(y) * np.cos(z),
            rate_y + rate_x * np.sin(z),
            rate_z * np.cos(y) - rate_x * np.sin(y) * np.cos(z),
        ),
        axis=-1,
    )
    parents = body.parent[1:]
    turning, velocity = np.zeros_like(placed.proximal), np.zeros_like(placed.proximal)
    turning[..., 1:, :] = _turned(placed.rotation[..., parents, :, :], own)
    turning = _ON_THE_WAY @ turning
    arms = placed.proximal[..., 1:, :] - placed.proximal[..., parents, :]
    velocity[..., 1:, :] = np.cross(turning[..., parents, :], arms)
    velocity = _ON_THE_WAY @ velocity + np.cross(turning, placed.centre - placed.proximal)
    in_own_axes = _turned(np.swapaxes(placed.rotation, -1, -2), turning)
    spin = _turned(placed.rotation, body.inertia * in_own_axes)
    momentum: Array = body.mass[:, np.newaxis] * np.cross(placed.centre, velocity) + spin
    return momentum.sum(axis=-2)


def _turned(matrices: Array, vectors: Array) -> Array:
    """Matrices (..., 3, 3) times vectors (..., 3)."""
    found: Array = (matrices @ vectors[..., np.newaxis])[..., 0]
    return found


def _turn_yzx(angles: Array) -> Array:
    """Rotations (..., 3, 3) about y, then the turned z, then the turned x, for angles (..., 3) in rad about y, z, x."""
    (cy, cz, cx), (sy, sz, sx) = np.moveaxis(np.cos(angles), -1, 0), np.moveaxis(np.sin(angles), -1, 0)
    rows = (
        (cy * cz, sy * sx - cy * sz * cx, cy * sz * sx + sy * cx),
        (sz, cz * cx, -cz * sx),
        (-sy * cz, sy * sz * cx + cy * sx, cy * cx - sy * sz * sx),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
