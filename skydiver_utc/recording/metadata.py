# SPDX-License-Identifier: Apache-2.0
"""The `metadata.yaml` of a rosbag2 bag folder, version 9."""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml

from skydiver_utc.recording.errors import RecordingError
from skydiver_utc.recording.mcap_file import StoredTopic

METADATA_FILE = "metadata.yaml"
_VERSION = 9
_NO_MESSAGE_YET_NS = 2**63 - 1  # rosbag2's starting time of an empty bag
_FOREVER = {"sec": 9223372036, "nsec": 854775807}  # "infinite" in rmw


class _PlainDumper(yaml.SafeDumper):
    """Writes no YAML aliases: not every reader of bags knows them."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def parse_qos_profiles(text: str) -> list[dict[str, Any]]:
    """Offered QoS profiles from a YAML list of mappings (empty text: none)."""
    try:
        profiles = yaml.safe_load(text) or []
    except yaml.YAMLError as error:
        raise RecordingError("The QoS profiles are not YAML: give a list of mappings.") from error
    if not isinstance(profiles, list) or not all(isinstance(profile, dict) for profile in profiles):
        raise RecordingError("The QoS profiles are no list of mappings: give one mapping for each profile.")
    return profiles


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
    return yaml.dump([profile], Dumper=_PlainDumper, sort_keys=False)


def metadata_yaml(mcap_name: str, topics: Sequence[StoredTopic], log_span_ns: tuple[int, int] | None) -> str:
    """The text of `metadata.yaml` for a bag of one file.

    `log_span_ns` is the first and the last log time in ns, None for a bag without messages.
    """
    first, last = log_span_ns or (_NO_MESSAGE_YET_NS, _NO_MESSAGE_YET_NS)
    span = {
        "duration": {"nanoseconds": last - first},
        "starting_time": {"nanoseconds_since_epoch": first},
        "message_count": sum(topic.message_count for topic in topics),
    }
    information = {
        "version": _VERSION,
        "storage_identifier": "mcap",
        **span,
        "topics_with_message_count": [_topic_entry(topic) for topic in topics],
        # These two are about compression by rosbag2 itself; chunks are compressed by the MCAP library.
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [mcap_name],
        "files": [{"path": mcap_name, **span}],
        "custom_data": None,
        "ros_distro": os.environ.get("ROS_DISTRO", "jazzy"),
    }
    return yaml.dump({"rosbag2_bagfile_information": information}, Dumper=_PlainDumper, sort_keys=False)


def _topic_entry(topic: StoredTopic) -> dict[str, Any]:
    return {
        "topic_metadata": {
            "name": topic.name,
            "type": topic.type_name,
            "serialization_format": "cdr",
            "offered_qos_profiles": topic.qos_profiles,
            "type_description_hash": topic.type_hash,
        },
        "message_count": topic.message_count,
    }


def write_atomically(path: Path, text: str) -> None:
    """Write a text file; at no time is there an incomplete file of this name."""
    draft = path.with_name(path.name + ".tmp")
    with draft.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    draft.replace(path)


def mcap_files(folder: Path) -> list[Path]:
    """The MCAP files of a bag folder in order: those in its metadata, without metadata every .mcap in it."""
    if not (folder / METADATA_FILE).is_file():
        return sorted(folder.glob("*.mcap"))
    with _reading(folder) as information:
        storage, names = information["storage_identifier"], information["relative_file_paths"]
        files = [folder / Path(name).name for name in names]
    if storage != "mcap":
        raise RecordingError(
            f"{folder} is a bag of {storage} files: convert it to mcap with `ros2 bag convert` and read that."
        )
    return files


def message_count(folder: Path) -> int:
    """Number of messages in a bag folder, from its metadata."""
    with _reading(folder) as information:
        return int(information["message_count"])


@contextmanager
def _reading(folder: Path) -> Iterator[Any]:
    path = folder / METADATA_FILE
    try:
        yield yaml.safe_load(path.read_text(encoding="utf-8"))["rosbag2_bagfile_information"]
    except (OSError, ValueError, KeyError, TypeError, yaml.YAMLError) as error:
        raise RecordingError(
            f"{path} is not the metadata of a bag: remove it to read the .mcap beside it."
        ) from error
