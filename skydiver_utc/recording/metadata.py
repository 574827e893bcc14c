# SPDX-License-Identifier: Apache-2.0
"""The `metadata.yaml` of a rosbag2 bag folder, version 9."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from skydiver_utc.errors import ParameterError, RecordingError
from skydiver_utc.parameters.yaml_io import load_yaml, write_yaml
from skydiver_utc.recording.mcap_file import LAST_TIME_NS, McapFile, StoredTopic

METADATA_FILE = "metadata.yaml"
QOS_KEY, HASH_KEY = "offered_qos_profiles", "topic_type_hash"  # in the metadata of a channel
_VERSION = 9
_FOREVER = {"sec": 9223372036, "nsec": 854775807}  # "infinite" in rmw


def offered_qos(depth: int, reliability: str, durability: str) -> str:
    """The text of one offered QoS profile, as rosbag2 writes it; rclpy's names of the policies."""
    profile = {
        "history": "keep_last",
        "depth": depth,
        "reliability": reliability.lower(),
        "durability": durability.lower(),
        "deadline": _FOREVER,
        "lifespan": _FOREVER,
        "liveliness": "automatic",
        "liveliness_lease_duration": _FOREVER,
        "avoid_ros_namespace_conventions": False,
    }
    return write_yaml([profile])


def metadata_yaml(mcap_name: str, mcap: McapFile, message_compression: str = "") -> str:
    """The text of `metadata.yaml` for a bag of one file; `message_compression` is that of each message by itself."""
    first, last = mcap.log_span_ns or (LAST_TIME_NS, LAST_TIME_NS)  # as rosbag2
    span = {
        "duration": {"nanoseconds": last - first},
        "starting_time": {"nanoseconds_since_epoch": first},
        "message_count": sum(topic.message_count for topic in mcap.topics),
    }
    information = {
        "version": _VERSION,
        "storage_identifier": "mcap",
        **span,
        "topics_with_message_count": _topic_entries(mcap.topics),
        # These two are about compression by rosbag2 itself; chunks are compressed by the MCAP library.
        "compression_format": message_compression,
        "compression_mode": "MESSAGE" if message_compression else "",
        "relative_file_paths": [mcap_name],
        "files": [{"path": mcap_name, **span}],
        "custom_data": None,
        "ros_distro": os.environ.get("ROS_DISTRO", "jazzy"),
    }
    return write_yaml({"rosbag2_bagfile_information": information})


def _topic_entries(topics: Sequence[StoredTopic]) -> list[dict[str, Any]]:
    """One entry a name, whose channels may be several."""
    entries: dict[str, dict[str, Any]] = {}
    for topic in topics:
        metadata = {
            "name": topic.name,
            "type": topic.definition.type_name,
            "serialization_format": topic.encoding,
            "offered_qos_profiles": recorded_qos_profiles(topic.metadata.get(QOS_KEY, "")),
            "type_description_hash": topic.metadata.get(HASH_KEY, ""),
        }
        entry = entries.setdefault(topic.name, {"topic_metadata": metadata, "message_count": 0})
        entry["message_count"] += topic.message_count
    return list(entries.values())


def recorded_qos_profiles(text: str) -> list[dict[str, Any]]:
    """The QoS profiles that a recording has, a YAML list of mappings; none where their text is damaged."""
    try:
        profiles = load_yaml(text, "the QoS profiles")
    except ParameterError:
        return []
    fine = isinstance(profiles, list) and all(isinstance(profile, dict) for profile in profiles)
    return profiles if fine else []


def mcap_files(folder: Path) -> list[Path]:
    """The MCAP files of a bag folder in order: those in its metadata, without usable metadata every .mcap in it."""
    listed = _information(folder).get("relative_file_paths")
    names = [Path(name).name for name in listed if isinstance(name, str)] if isinstance(listed, list) else []
    files = [folder / name for name in dict.fromkeys(names) if name.endswith(".mcap")]
    files = files or sorted(folder.glob("*.mcap"))
    if not files and any(path.suffix in (".db3", ".zstd") for path in folder.iterdir()):
        raise RecordingError(
            f"{folder} is a bag of other files than .mcap: convert it with `rosbags-convert --src {folder} --dst"
            " FOLDER --dst-storage mcap`, which is installed with this package, and give that folder"
        )
    return files


def message_count(folder: Path) -> int | None:
    """Number of messages in a bag folder from its metadata, None without usable ones."""
    count = _information(folder).get("message_count")
    return count if isinstance(count, int) else None


def _information(folder: Path) -> dict[str, Any]:
    """The content of `metadata.yaml`, empty where it cannot be used: everything in it is in the .mcap, too."""
    try:
        content = load_yaml((folder / METADATA_FILE).read_text(encoding="utf-8"), METADATA_FILE)
    except (OSError, UnicodeDecodeError, ParameterError):
        return {}
    found = content.get("rosbag2_bagfile_information") if isinstance(content, dict) else None
    return found if isinstance(found, dict) else {}
