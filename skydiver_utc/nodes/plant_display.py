# SPDX-License-Identifier: Apache-2.0
"""Topics on which RViz, Foxglove and other displays draw a plant: URDF, joint angles, transforms and markers."""

from typing import Any

import numpy as np
from geometry_msgs.msg import Point, TransformStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import ColorRGBA, String
from visualization_msgs.msg import Marker, MarkerArray

from skydiver_utc.arrays import Array
from skydiver_utc.messages import fill_named, fill_pose
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.node import ScenarioNode
from skydiver_utc.plants.protocol import FORCE_M_PER_N, Plant

_RATE_HZ = 25.0
_LINE_WIDTH_M = 0.012  # of a force's line
_BODY_COLOR = ColorRGBA(r=0.0, g=0.45, b=0.70, a=1.0)
_FORCE_COLOR = ColorRGBA(r=0.90, g=0.62, b=0.0, a=1.0)


class PlantDisplay:
    """Publishes at 25 Hz of simulated time; a topic without subscribers costs nothing.

    `markers`: an ellipsoid for each of the plant's shapes, and a list of lines for the forces on them. Transforms:
    `body` of the odometry and `base_link` of the URDF, on `/tf` where tf2_msgs is installed, else on `transforms`.
    """

    def __init__(self, node: ScenarioNode, plant: Plant) -> None:
        self._grid, self._plant = node.grid, plant
        self._every = max(1, round(1.0 / (_RATE_HZ * node.scenario.dt_s)))
        description = plant.robot_description()
        frames = ["body"] * (plant.state_message == "odometry") + ["base_link"] * bool(description)
        self._joints = node.advertise(topics.JOINT_STATES) if plant.joint_names else None
        self._markers = node.advertise(topics.MARKERS) if plant.shapes and node.settings.markers else None
        self._frames = node.advertise(topics.TRANSFORMS) if frames else None
        self._joints_message = JointState(name=list(plant.joint_names))
        axes = [(2.0 * shape.half_axes).tolist() for shape in plant.shapes]
        self._shapes = [_marker("segments", i, Marker.SPHERE, _BODY_COLOR, a) for i, a in enumerate(axes)]
        self._lines = _marker("forces", 0, Marker.LINE_LIST, _FORCE_COLOR, [_LINE_WIDTH_M, 0.0, 0.0])
        self._transforms = [_transform(frame) for frame in frames]
        # Compiled before the run.
        state, applied = plant.initial_state(), plant.initial_applied()
        if self._markers is not None:
            self._marked(0, state, applied)
        self._placed(0, state, applied)
        if description:
            node.advertise(topics.ROBOT_DESCRIPTION).publish(String(data=description))

    def publish(self, k: int, state: Array, applied: Array) -> None:
        """State (n,) at step k, with what the actuators hold then (a,)."""
        if k % self._every:
            return
        if joints := _if_subscribed(self._joints):
            self._grid.set_stamp(self._joints_message.header.stamp, k)
            joints.publish(fill_named(self._joints_message, self._plant.joint_angles(applied)))
        if markers := _if_subscribed(self._markers):
            markers.publish(MarkerArray(markers=self._marked(k, state, applied)))
        if frames := _if_subscribed(self._frames):
            transforms, kind = self._placed(k, state, applied), topics.TRANSFORMS.type
            alone = kind is TransformStamped
            for message in transforms if alone else [kind(transforms=transforms)]:
                frames.publish(message)

    def _placed(self, k: int, state: Array, applied: Array) -> list[Any]:
        for message in self._transforms:
            of_body = message.child_frame_id == "body"
            pose = state[:7] if of_body else self._plant.robot_pose(state, applied)
            self._grid.set_stamp(message.header.stamp, k)
            fill_pose(message.transform.translation, message.transform.rotation, pose)
        return self._transforms

    def _marked(self, k: int, state: Array, applied: Array) -> list[Any]:
        poses, forces = self._plant.shape_poses(state, applied), self._plant.shape_forces(state, applied)
        for marker, pose in zip(self._shapes, poses, strict=True):
            fill_pose(marker.pose.position, marker.pose.orientation, pose)
        centres = poses[: len(forces), :3]
        ends = np.stack([centres, centres + FORCE_M_PER_N * forces], axis=1).reshape(-1, 3)
        self._lines.points = [Point(x=x, y=y, z=z) for x, y, z in ends.tolist()]
        markers = [*self._shapes, self._lines] if len(forces) else self._shapes
        for marker in markers:
            self._grid.set_stamp(marker.header.stamp, k)
        return markers


def _if_subscribed(publisher: Any) -> Any:
    return publisher if publisher is not None and publisher.get_subscription_count() else None


def _marker(namespace: str, i: int, kind: int, color: ColorRGBA, scale: list[float]) -> Any:
    marker = Marker(ns=namespace, id=i, type=kind, color=color)
    marker.header.frame_id = "world"
    marker.scale.x, marker.scale.y, marker.scale.z = scale
    return marker


def _transform(frame: str) -> Any:
    message = TransformStamped(child_frame_id=frame)
    message.header.frame_id = "world"
    return message
