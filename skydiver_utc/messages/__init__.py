# SPDX-License-Identifier: Apache-2.0
"""Arrays into ROS messages and back, the grid of steps, and previews of the reference.

A message object is only looked at by its fields: the nodes hand in objects of rclpy, the analysis those of its
decoder, so this room imports neither. Reading returns arrays or raises `MessageError`.
"""

from skydiver_utc.messages.errors import MessageError, Refusals
from skydiver_utc.messages.fields import TWIST_COMPONENTS, fill_fields, read_fields
from skydiver_utc.messages.grid import StepGrid
from skydiver_utc.messages.named import fill_named, read_named
from skydiver_utc.messages.preview import PreviewStore, fill_preview, read_preview
from skydiver_utc.messages.state import fill_pose, fill_state, read_state
from skydiver_utc.messages.texts import (
    change_text,
    outcome_text,
    read_outcome,
    run_id_of,
    scenario_text,
)

__all__ = [
    "TWIST_COMPONENTS",
    "MessageError",
    "PreviewStore",
    "Refusals",
    "StepGrid",
    "change_text",
    "fill_fields",
    "fill_named",
    "fill_pose",
    "fill_preview",
    "fill_state",
    "outcome_text",
    "read_fields",
    "read_named",
    "read_outcome",
    "read_preview",
    "read_state",
    "run_id_of",
    "scenario_text",
]
