"""Arrays into messages and back, with every check at the border.

A writer keeps one message object and fills it anew: publishing serialises at once, so it can be reused.
Values pass through `float()` or an `array.array`, since rclpy sends anything else as garbage, in silence.
A reader returns arrays or raises `BorderError` with one sentence.
"""

import array
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from skydiver_utc.nodes.border import BorderError
from skydiver_utc.nodes.stamps import StepGrid
from skydiver_utc.parameters import Signal
from skydiver_utc.simulation.outcome import LARGEST_RATE_RAD_S, LARGEST_SPEED_M_S, speed_and_rate

Vector = NDArray[np.float64]

WORLD_FRAME = "world"
BODY_FRAME = "body"

# The component of a setpoint's angular velocity that holds a body rate; the pattern angle has no setpoint.
SETPOINT_AXES: Mapping[Signal, str] = {"pitch_rate": "y", "yaw_rate": "z"}
_STATE_NAMES = ("x", "y", "z", "qx", "qy", "qz", "qw", "vx", "vy", "vz", "wx", "wy", "wz")
# A unit quaternion after integration differs from length 1 by rounding only.
_QUATERNION_TOLERANCE = 1e-6


class StateWriter:
    """State (13,) into nav_msgs/Odometry: pose in `world`, twist in `body`."""

    def __init__(self, grid: StepGrid) -> None:
        self._grid = grid
        self._message = Odometry()
        self._message.header.frame_id = WORLD_FRAME
        self._message.child_frame_id = BODY_FRAME

    def fill(self, k: int, state: Vector) -> Any:
        """The message of state (13,) at step k."""
        message = self._message
        self._grid.set_stamp(message.header.stamp, k)
        pose, twist = message.pose.pose, message.twist.twist
        position, quaternion, linear, angular = pose.position, pose.orientation, twist.linear, twist.angular
        position.x, position.y, position.z = state[0:3].tolist()
        quaternion.x, quaternion.y, quaternion.z, quaternion.w = state[3:7].tolist()
        linear.x, linear.y, linear.z = state[7:10].tolist()
        angular.x, angular.y, angular.z = state[10:13].tolist()
        return message


def read_state(message: Any) -> Vector:
    """State (13,) of a nav_msgs/Odometry."""
    frames = (message.header.frame_id, message.child_frame_id)
    if frames != (WORLD_FRAME, BODY_FRAME):
        raise BorderError(
            "frame",
            f"its frames are {frames}: they must be {(WORLD_FRAME, BODY_FRAME)}",
        )
    p, q = message.pose.pose.position, message.pose.pose.orientation
    v, w = message.twist.twist.linear, message.twist.twist.angular
    state = np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w, v.x, v.y, v.z, w.x, w.y, w.z])
    _refuse_non_finite(state, _STATE_NAMES)
    length = math.hypot(*state[3:7])
    if abs(length - 1.0) > _QUATERNION_TOLERANCE:
        raise BorderError("quaternion", f"its quaternion has length {length:.9g}: it must have length 1")
    speed, rate = speed_and_rate(state)
    if not (speed < LARGEST_SPEED_M_S and rate < LARGEST_RATE_RAD_S):
        raise BorderError(
            "model", f"its speed {speed:.3g} m/s or body rate {rate:.3g} rad/s is beyond the model"
        )
    return state


class NamedValuesWriter:
    """Values by name into the `position` of a sensor_msgs/JointState."""

    def __init__(self, grid: StepGrid, names: Sequence[str]) -> None:
        self._grid = grid
        self._message = JointState()
        self._message.name = list(names)
        self._message.position = array.array("d", bytes(8 * len(names)))
        self._size = len(names)

    def fill(self, k: int, values: Vector) -> Any:
        """The message of values (n,) at step k, in the order of the names."""
        if len(values) != self._size:
            raise ValueError(f"{len(values)} values for {self._size} names")
        self._grid.set_stamp(self._message.header.stamp, k)
        self._message.position[:] = array.array("d", values.tolist())
        return self._message


def read_named_values(message: Any, names: Sequence[str]) -> Vector:
    """Values (n,) of a sensor_msgs/JointState that must name exactly `names`, in this order."""
    if message.name != list(names):
        raise BorderError("names", f"it names {list(message.name)}: it must name, in order, {list(names)}")
    if len(message.position) != len(names):
        raise BorderError(
            "size", f"it has {len(message.position)} values in position for {len(names)} names: give one each"
        )
    values = np.array(message.position, dtype=np.float64)
    _refuse_non_finite(values, names)
    return values


class SetpointWriter:
    """The body rate wanted now, rad/s, into a geometry_msgs/TwistStamped."""

    def __init__(self, grid: StepGrid, signal: Signal) -> None:
        self._grid = grid
        self._axis = SETPOINT_AXES[signal]
        self._message = TwistStamped()
        self._message.header.frame_id = BODY_FRAME

    def fill(self, k: int, rate: float) -> Any:
        """The message of step k."""
        self._grid.set_stamp(self._message.header.stamp, k)
        setattr(self._message.twist.angular, self._axis, float(rate))
        return self._message


class ClockWriter:
    """The time of a step into a rosgraph_msgs/Clock."""

    def __init__(self, grid: StepGrid) -> None:
        self._grid = grid
        self._message = Clock()

    def fill(self, k: int) -> Any:
        """The message of step k."""
        self._grid.set_stamp(self._message.clock, k)
        return self._message


def _refuse_non_finite(values: Vector, names: Sequence[str]) -> None:
    finite = np.isfinite(values)
    if not finite.all():
        i = int(np.argmin(finite))
        raise BorderError("finite", f"its {names[i]} is {values[i]}: every value must be finite")
