# SPDX-License-Identifier: Apache-2.0
"""Reads recordings: rosbag2 bag folders with MCAP files, or bare MCAP files, without ROS."""

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Channel, Footer, Schema, Statistics
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

from skydiver_utc.arrays import Integers
from skydiver_utc.errors import RecordingError
from skydiver_utc.recording.mcap_file import LAST_TIME_NS
from skydiver_utc.recording.metadata import HASH_KEY, QOS_KEY, mcap_files
from skydiver_utc.recording.records import DAMAGE, Damaged, parts, unpacked

_ENCAPSULATION_LENGTH = 4
# What rosbags raises on definitions and messages that come from anywhere.
_UNREADABLE = (*DAMAGE, TypesysError, SerdeError, SyntaxError)
# Of the lists of texts or messages with a fixed length in a definition: rosbags writes code for each, 5 ms and 40 kB.
_MOST_ENTRIES = 100
_LONG_LISTS = re.compile(r"^\s*(?!(?:bool|byte|char|u?int\d+|float\d+)\[)\S+\[(\d+)\]", re.MULTILINE)


@dataclass(eq=False)
class RecordedTopic:
    """The messages of one topic, in the order of the file; times in ns."""

    name: str
    type_name: str
    definition: str = field(repr=False)  # ros2msg with all dependencies
    type_hash: str = ""  # RIHS01, empty if unknown
    qos_profiles_yaml: str = field(default="", repr=False)
    cdr: list[bytes] = field(default_factory=list, repr=False)
    times_ns: list[tuple[int, int]] = field(default_factory=list, repr=False)  # of log and publishing
    places: list[int] = field(default_factory=list, repr=False)  # of the messages among all of the bag
    left_out: int = 0  # messages of another type, with impossible times, or damaged by their compression

    def __len__(self) -> int:
        return len(self.cdr)

    @property
    def log_times_ns(self) -> Integers:
        """Log times (n,)."""
        return np.array([log for log, _ in self.times_ns], dtype=np.int64)

    @property
    def publish_times_ns(self) -> Integers:
        """Publish times (n,)."""
        return np.array([publish for _, publish in self.times_ns], dtype=np.int64)

    def add(self, cdr: bytes, log_time: int, publish_time: int, place: int) -> None:
        """Take in a message, or count it as left out."""
        try:
            if max(log_time, publish_time) > LAST_TIME_NS:
                raise ValueError("a time is beyond the last one")
            self.cdr.append(unpacked(cdr))
        except DAMAGE:
            self.left_out += 1
            return
        self.times_ns.append((log_time, publish_time))
        self.places.append(place)

    @cached_property
    def readable(self) -> list[Any | None]:
        """The deserialized messages, None for each whose bytes do not fit the type."""
        try:
            decode = _decoder(self.type_name, self.definition)
        except _UNREADABLE:
            return [None] * len(self.cdr)
        return [_or_none(decode, cdr) for cdr in self.cdr]


def _or_none(decode: Callable[[bytes], Any], cdr: bytes) -> Any | None:
    try:
        return decode(cdr)
    except _UNREADABLE:
        return None


def read_bag(path: Path, topics: Iterable[str] | None = None) -> dict[str, RecordedTopic]:
    """The recorded topics by name, all of them or those given.

    `path` is a bag folder or an .mcap file. Messages are deserialized at the first use of `RecordedTopic.readable`.
    An unfinished or damaged bag, one without messages, and a topic that is not in the bag raise `RecordingError`.
    """
    contents = _Contents(None if topics is None else set(topics))
    for file in bag_files(path):
        contents.add(file)
    if contents.message_count == 0:
        raise RecordingError(f"{path} holds no messages: record the run again.")
    for name in sorted((contents.wanted or set()) - contents.topics.keys()):
        if name in contents.topic_names:
            raise RecordingError(
                f"{name} in {path} holds no ROS 2 messages with a ros2msg definition: leave it out."
            )
        available = ", ".join(sorted(contents.topic_names))
        raise RecordingError(f"{path} has no topic {name}: choose from {available}.")
    return contents.topics


def bag_files(path: Path) -> list[Path]:
    """The MCAP files of a bag folder, or the file itself."""
    if not path.exists():
        raise RecordingError(f"{path} does not exist: give the folder of a recording or its .mcap file.")
    files = mcap_files(path) if path.is_dir() else [path]
    if not files:
        raise RecordingError(f"{path} is not a bag, it has no .mcap file: give the folder of a recording.")
    for file in files:
        if not file.is_file():
            raise RecordingError(f"{file} is missing from the bag: copy it back, or record the run again.")
    return files


class _Contents:
    """The wanted messages of the files read so far."""

    def __init__(self, wanted: set[str] | None) -> None:
        self.wanted = wanted
        self.topics: dict[str, RecordedTopic] = {}
        self.topic_names: set[str] = set()
        self.message_count = 0

    def add(self, path: Path) -> None:
        # Schemas and channels stand before their first message and again at the end of the file.
        schemas: dict[int, Schema] = {}
        channels: dict[int, str] = {}
        readable: dict[int, RecordedTopic] = {}
        before = self.message_count
        damage, whole = "", False
        for part in parts(path):
            if isinstance(part, tuple) and not isinstance(part, Damaged):
                channel_id, log_time, publish_time, cdr = part
                self.message_count += 1
                if channel_id in readable:
                    readable[channel_id].add(cdr, log_time, publish_time, self.message_count)
                elif (topic := self.topics.get(channels.get(channel_id, ""))) is not None:
                    topic.left_out += 1
            elif isinstance(part, Schema):
                schemas[part.id] = part
            elif isinstance(part, Channel) and part.id not in channels:
                channels[part.id] = part.topic
                self.topic_names.add(part.topic)
                if (topic := self._topic(part, schemas.get(part.schema_id))) is not None:
                    readable[part.id] = topic
            elif isinstance(part, Damaged):
                damage = damage or part.reason
            elif (
                isinstance(part, Statistics) and (count := self.message_count - before) != part.message_count
            ):
                damage = damage or f"{count} of {part.message_count} messages found"
            whole = whole or isinstance(part, Footer)
        if not whole:
            raise RecordingError(
                f"{path} has no end, it is still being recorded or its recorder was killed: save its messages"
                f" with `skydiver-utc recover {path}` and read that."
            )
        if damage:
            raise RecordingError(
                f"{path} is damaged ({damage}): save the rest with `skydiver-utc recover {path}` and read that."
            )

    def _topic(self, channel: Channel, schema: Schema | None) -> RecordedTopic | None:
        """The topic of a channel; None if it is not wanted or its messages are not those of a ROS 2 topic."""
        wanted = self.wanted is None or channel.topic in self.wanted
        if not wanted or schema is None or (schema.encoding, channel.message_encoding) != ("ros2msg", "cdr"):
            return None
        metadata = channel.metadata
        new = RecordedTopic(
            channel.topic,
            schema.name,
            schema.data.decode(errors="replace"),
            metadata.get(HASH_KEY, ""),
            metadata.get(QOS_KEY, ""),
        )
        topic = self.topics.setdefault(channel.topic, new)
        return topic if (topic.type_name, topic.definition) == (new.type_name, new.definition) else None


@lru_cache(maxsize=64)
def _decoder(type_name: str, text: str) -> Callable[[bytes], Any]:
    """A function that deserializes messages of a type with this definition; cached, because building it takes 0.1 s."""
    if sum(map(int, _LONG_LISTS.findall(text))) > _MOST_ENTRIES:
        raise ValueError(f"its lists of texts or messages have more than {_MOST_ENTRIES} entries")
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(text, type_name))
    # store.deserialize_cdr refuses the padding that rclpy.serialization leaves at the end of some messages.
    definition = store.get_msgdef(type_name)

    def decode(data: bytes) -> Any:
        little_endian = data[1] & 1
        of_order = definition.deserialize_cdr_le if little_endian else definition.deserialize_cdr_be
        return of_order(data[_ENCAPSULATION_LENGTH:], 0, definition.cls, store)[0]

    return decode


DEFAULT_NAMESPACE = "/skydiver"


def namespace_of(topic_names: Iterable[str], name: str = "scenario") -> str:
    """The namespace of the topic with this relative name, or `DEFAULT_NAMESPACE`; several raise `RecordingError`."""
    ending = f"/{name}"
    found = sorted(topic.removesuffix(ending) for topic in topic_names if topic.endswith(ending))
    if len(found) > 1:
        raise RecordingError(
            f"The recording holds several namespaces ({', '.join(found)}): record each into its own bag, as"
            " `skydiver-utc run` does."
        )
    return found[0] if found else DEFAULT_NAMESPACE
