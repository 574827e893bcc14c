# SPDX-License-Identifier: Apache-2.0
"""Messages as plain objects with the fields of their ROS types: what `skydiver_utc.messages` looks at."""

from types import SimpleNamespace
from typing import Any


def time(sec: int = 0, nanosec: int = 0) -> Any:
    """builtin_interfaces/Time, or Duration."""
    return SimpleNamespace(sec=sec, nanosec=nanosec)


def header(frame_id: str = "") -> Any:
    """std_msgs/Header."""
    return SimpleNamespace(stamp=time(), frame_id=frame_id)


def joint_state(names: tuple[str, ...], position: Any = ()) -> Any:
    """sensor_msgs/JointState."""
    return SimpleNamespace(header=header(), name=list(names), position=position)


def twist() -> Any:
    """geometry_msgs/Twist."""
    return SimpleNamespace(
        linear=SimpleNamespace(x=0.0, y=0.0, z=0.0), angular=SimpleNamespace(x=0.0, y=0.0, z=0.0)
    )


def odometry(world: str = "world", body: str = "body") -> Any:
    """nav_msgs/Odometry."""
    pose = SimpleNamespace(
        position=SimpleNamespace(x=0.0, y=0.0, z=0.0), orientation=SimpleNamespace(x=0.0, y=0.0, z=0.0, w=1.0)
    )
    return SimpleNamespace(
        header=header(world),
        child_frame_id=body,
        pose=SimpleNamespace(pose=pose),
        twist=SimpleNamespace(twist=twist()),
    )


def trajectory(names: tuple[str, ...], points: int) -> Any:
    """trajectory_msgs/JointTrajectory with so many empty points."""
    return SimpleNamespace(
        header=header(),
        joint_names=list(names),
        points=[SimpleNamespace(positions=[], time_from_start=time()) for _ in range(points)],
    )


def put(message: Any, place: str, value: Any) -> None:
    """Set a field of a message, or an entry of a list in it, as `points.2.positions.1`."""
    *path, last = place.split(".")
    for part in path:
        message = message[int(part)] if part.isdecimal() else getattr(message, part)
    if last.isdecimal():
        message[int(last)] = value
    else:
        setattr(message, last, value)
