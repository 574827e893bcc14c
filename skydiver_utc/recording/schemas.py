# SPDX-License-Identifier: Apache-2.0
"""Message definitions and type hashes, from the share folders of the installed ROS message packages."""

import importlib.util
import json
import os
import re
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

from skydiver_utc.errors import RecordingError

_TYPE_NAME = re.compile(r"(?P<package>[a-z][a-z0-9_]*)/msg/(?P<message>[A-Z][A-Za-z0-9]*)")
_SEPARATOR = "\n" + "=" * 80 + "\nMSG: "


class MessageSchema(NamedTuple):
    """A message type in a bag: name, ros2msg text with all dependencies, RIHS01 hash."""

    type_name: str
    text: str
    type_hash: str


@cache
def message_schema(type_name: str) -> MessageSchema:
    """The schema of a type such as `nav_msgs/msg/Odometry`; `RecordingError` if it is not installed."""
    # The description lists the type and its dependencies, each with its hash.
    hashes = {entry["type_name"]: entry["hash_string"] for entry in _description(type_name)["type_hashes"]}
    parts = [_definition(type_name)]
    for dependency in hashes:
        if dependency != type_name:
            parts.append(f"{dependency.replace('/msg/', '/')}\n{_definition(dependency)}")
    return MessageSchema(type_name, _SEPARATOR.join(parts), hashes[type_name])


def _definition(type_name: str) -> str:
    return _installed_file(type_name, ".msg").read_text(encoding="utf-8")


def _description(type_name: str) -> dict[str, list[dict[str, str]]]:
    content: dict[str, list[dict[str, str]]] = json.loads(
        _installed_file(type_name, ".json").read_text(encoding="utf-8")
    )
    return content


def _installed_file(type_name: str, suffix: str) -> Path:
    match = _TYPE_NAME.fullmatch(type_name)
    if match is None:
        raise RecordingError(f"{type_name!r} is not a message type: write it as in 'nav_msgs/msg/Odometry'.")
    package, message = match["package"], match["message"]
    for share in _share_folders(package):
        file = share / "msg" / f"{message}{suffix}"
        if file.is_file():
            return file
    raise RecordingError(
        f"The definition of {type_name} is not installed ({package}/msg/{message}{suffix}): install the ROS 2"
        f" Jazzy package {package}, or source the ROS environment that has it."
    )


def _share_folders(package: str) -> Iterator[Path]:
    """Candidates for the share folder of a package, best first.

    First beside the Python package, because messages are serialized by its definitions; then the prefixes of a
    sourced ROS environment; then this Python's prefix. Nothing is imported.
    """
    spec = importlib.util.find_spec(package)
    for location in (spec.submodule_search_locations or ()) if spec else ():
        for parent in Path(location).parents:
            yield parent / "share" / package
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if prefix:
            yield Path(prefix) / "share" / package
    yield Path(sys.prefix) / "share" / package
