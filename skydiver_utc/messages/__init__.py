# SPDX-License-Identifier: Apache-2.0
"""Arrays into ROS messages and back, the grid of steps, and previews of the reference.

A message object is only looked at by its fields: the nodes hand in objects of rclpy, the analysis those of its
decoder, so this room imports neither. Reading returns arrays or raises `MessageError`.
"""

from skydiver_utc.messages.errors import MessageError, Refusals
from skydiver_utc.messages.grid import StepGrid
from skydiver_utc.messages.named import fill_named, read_named
from skydiver_utc.messages.odometry import POSE_TWIST_NAMES, fill_odometry, fill_pose, read_odometry
from skydiver_utc.messages.preview import PreviewStore, fill_preview, read_preview
from skydiver_utc.messages.sensors import fill_sensor, read_sensor
from skydiver_utc.messages.state import fill_state, read_state
from skydiver_utc.messages.texts import (
    change_text,
    outcome_text,
    read_outcome,
    run_id_of,
    scenario_text,
)
from skydiver_utc.messages.twist import TWIST_COMPONENTS, fill_twist, read_twist

__all__ = [
    "POSE_TWIST_NAMES",
    "TWIST_COMPONENTS",
    "MessageError",
    "PreviewStore",
    "Refusals",
    "StepGrid",
    "change_text",
    "fill_named",
    "fill_odometry",
    "fill_pose",
    "fill_preview",
    "fill_sensor",
    "fill_state",
    "fill_twist",
    "outcome_text",
    "read_named",
    "read_odometry",
    "read_outcome",
    "read_preview",
    "read_sensor",
    "read_state",
    "read_twist",
    "run_id_of",
    "scenario_text",
]
