# SPDX-License-Identifier: Apache-2.0
"""A plant's state: of a rigid body (13,) in a nav_msgs/Odometry, pose in the world, twist in the body; else by name."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.messages.errors import MessageError, refuse_non_finite
from skydiver_utc.messages.named import fill_named, read_named

# position [m], quaternion x y z w (body to world), velocity [m/s] and rates [rad/s] in body axes
_NAMES = ("x", "y", "z", "qx", "qy", "qz", "qw", "vx", "vy", "vz", "wx", "wy", "wz")
# An integrated unit quaternion differs from length 1 by rounding only and is kept to the bit; a vehicle's own
# may be rounded and is normalised.
_ROUNDING, _LARGEST_ERROR = 1e-6, 1e-3


def fill_state(message: Any, state: Array) -> Any:
    """Write a state (n,); a JointState has the names already. Returns the message."""
    if not hasattr(message, "pose"):
        return fill_named(message, state)
    pose, twist = message.pose.pose, message.twist.twist
    linear, angular = twist.linear, twist.angular
    fill_pose(pose.position, pose.orientation, state[:7])
    linear.x, linear.y, linear.z = state[7:10].tolist()
    angular.x, angular.y, angular.z = state[10:13].tolist()
    return message


def read_state(message: Any, names: Sequence[str] = (), frames: tuple[str, str] | None = None) -> Array:
    """The state (n,), of a JointState in the order of the names; an Odometry must be in these frames, if given.

    `frames`: world, body.
    """
    if not hasattr(message, "pose"):
        return read_named(message, names)
    if len(names) not in (0, len(_NAMES)):
        raise MessageError("size", f"it has {len(_NAMES)} numbers: the plant has {len(names)} states")
    found = (message.header.frame_id, message.child_frame_id)
    if frames is not None and found != frames:
        raise MessageError("frame", f"its frames are {found}: they must be {frames}")
    p, q = message.pose.pose.position, message.pose.pose.orientation
    v, w = message.twist.twist.linear, message.twist.twist.angular
    state = np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w, v.x, v.y, v.z, w.x, w.y, w.z])
    refuse_non_finite(state, _NAMES)
    length = math.hypot(*state[3:7])
    if abs(length - 1.0) > _LARGEST_ERROR:
        raise MessageError("quaternion", f"its quaternion has length {length:.9g}: it must have length 1")
    if abs(length - 1.0) > _ROUNDING:
        state[3:7] /= length
    return state


def fill_pose(position: Any, quaternion: Any, pose: Array) -> None:
    """Write a pose (7,) into a Point or Vector3 and a Quaternion."""
    position.x, position.y, position.z, quaternion.x, quaternion.y, quaternion.z, quaternion.w = pose.tolist()
