"""A seeded source of hostile messages for every input of the nodes."""

import hashlib
import json
import random
import time
from typing import Any

import numpy as np
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from skydiver_utc.nodes.stamps import StepGrid
from skydiver_utc.plant.skydiver import CONTROL_NAMES

COUNT = 10_000
NUMBERS = (0.0, -0.0, 1.0, -1.0, 5e-324, 1e-300, 1e300, -1e300, 1.7976931348623157e308, 1e9, -1e9)
NOT_FINITE = (float("nan"), float("inf"), float("-inf"))


class Hostile:
    """A seeded source of messages, from right ones with strange values to nonsense."""

    def __init__(self, seed: int, grid: StepGrid) -> None:
        self.random = random.Random(seed)
        self.grid = grid

    def number(self) -> float:
        draw = self.random.random()
        if draw < 0.05:
            return self.random.choice(NOT_FINITE)
        if draw < 0.3:
            return self.random.choice(NUMBERS)
        return self.random.gauss(0.0, 1.0) * 10.0 ** self.random.uniform(-6, 4)

    def numbers(self, count: int) -> list[float]:
        """Of the right count most of the time."""
        if self.random.random() < 0.05:
            count = self.random.choice((0, 1, count + 1, 50))
        return [self.number() for _ in range(count)]

    def names(self, names: tuple[str, ...]) -> list[str]:
        draw = self.random.random()
        if draw < 0.9:
            return list(names)
        if draw < 0.93:
            return self.random.sample(names, len(names))
        if draw < 0.96:
            return list(names[: self.random.randrange(len(names))])
        return [self.random.choice(("", "é\u4e2d", "x" * 5000, names[0])) for _ in names]

    def stamp(self, stamp: Any, k: int) -> None:
        """Of step k most of the time, else of an older or a coming one, off the grid, or anything."""
        draw = self.random.random()
        if draw < 0.6:
            self.grid.set_stamp(stamp, max(0, k))
        elif draw < 0.9:
            self.grid.set_stamp(stamp, max(0, k + self.random.randrange(-50, 50)))
        elif draw < 0.95:
            self.grid.set_stamp(stamp, max(0, k))
            stamp.nanosec = (stamp.nanosec + 1) % 10**9
        else:
            stamp.sec = self.random.choice((-(2**31), -1, 0, 2**31 - 1))
            stamp.nanosec = self.random.choice((0, 1, 999_999_999, 2**32 - 1))

    def controls(self, k: int) -> Any:
        message = JointState(name=self.names(CONTROL_NAMES), position=self.numbers(4))
        self.stamp(message.header.stamp, k)
        return message

    def state(self, k: int, near: Any) -> Any:
        message = Odometry()
        self.stamp(message.header.stamp, k)
        if self.random.random() < 0.95:
            message.header.frame_id, message.child_frame_id = "world", "body"
        values = near.copy()
        scale = 10.0 ** self.random.uniform(-3, 3)
        values[7:] += scale * np.array([self.random.gauss(0, 1) for _ in range(6)])
        turned = values[3:7] + scale * np.array([self.random.gauss(0, 1) for _ in range(4)])
        values[3:7] = turned / np.sqrt(turned @ turned)
        if self.random.random() < 0.3:
            values[self.random.randrange(13)] = self.number()
        pose, twist = message.pose.pose, message.twist.twist
        for target, axes, part in (
            (pose.position, "xyz", values[:3]),
            (pose.orientation, "xyzw", values[3:7]),
            (twist.linear, "xyz", values[7:10]),
            (twist.angular, "xyz", values[10:]),
        ):
            for axis, value in zip(axes, part, strict=True):
                setattr(target, axis, float(value))
        return message

    def preview(self, k: int, count: int) -> Any:
        message = JointTrajectory(joint_names=self.names(("yaw_rate",)))
        self.stamp(message.header.stamp, k)
        strange = self.random.random()
        for i in range(count if strange < 0.9 else self.random.randrange(3)):
            value = self.number() if strange < 0.2 else self.random.gauss(0.0, 30.0)
            point = JointTrajectoryPoint(velocities=[value] if strange < 0.95 else [])
            self.grid.set_duration(point.time_from_start, i)
            message.points.append(point)
        return message

    def text(self) -> Any:
        """A whole claim of a node that does not exist, what such a plant says of its clock, or no claim at all."""
        claim: dict[str, Any] = {
            "kind": self.random.choice(("plant", "controller", "reference")),
            "id": self.random.choice(("x", "y", "")),
            "since_ns": self.random.choice((1, time.time_ns(), 2**63 - 1)),
            "serving": self.random.random() < 0.5,
            "pid": 1,
            "host": "h",
            "scenario": self.random.choice(("", hashlib.sha256(b"").hexdigest())),
        }
        whole = self.random.random()
        if whole < 0.2:
            return String(data=json.dumps(claim))
        if whole < 0.3:
            namespace = self.random.choice(("/z", "", "/", "{ns}", "/skydiver/", "/skydiver\0", "/é"))
            grid = {"dt_ns": self.grid.dt_ns, "epoch_ns": self.grid.epoch_ns}
            clock = {"claim": claim, "namespace": namespace, "mode": "lockstep", **grid}
            return String(data=json.dumps(clock))
        key = self.random.choice(list(claim))
        claim[key] = self.random.choice((None, [], {}, "", 1e300, -1, 2**80, True))
        kind = self.random.randrange(3)
        if kind == 0:
            return String(data=json.dumps(claim | {"kind": "someone"} if key != "kind" else claim))
        letters = '{}[]",:\\0123456789eE+-.nulltruefalse é\u0000'
        return String(data="".join(self.random.choices(letters, k=self.random.randrange(60))))
