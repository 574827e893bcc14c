# SPDX-License-Identifier: Apache-2.0
"""Message definitions and type hashes of ROS 2 Jazzy, as rosbags has them: no ROS is needed."""

from functools import cache
from typing import NamedTuple

from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from skydiver_utc.errors import RecordingError


class MessageSchema(NamedTuple):
    """A message type in a bag: name, ros2msg text with all dependencies, RIHS01 hash."""

    type_name: str
    text: str
    type_hash: str


def type_hash(type_name: str) -> str:
    """The RIHS01 hash of a type such as `nav_msgs/msg/Odometry`; empty for one that Jazzy does not have."""
    store = _jazzy()
    return store.hash_rihs01(type_name) if type_name in store.fielddefs else ""


def message_schema(type_name: str) -> MessageSchema:
    """The schema of a type that Jazzy has; `RecordingError` for any other."""
    if not (found := type_hash(type_name)):
        raise RecordingError(
            f"{type_name!r} is no message type of ROS 2 Jazzy: write one as in 'nav_msgs/msg/Odometry'"
        )
    return MessageSchema(type_name, _jazzy().generate_msgdef(type_name, ros_version=2)[0], found)


@cache
def _jazzy() -> Typestore:
    return get_typestore(Stores.ROS2_JAZZY)
