# SPDX-License-Identifier: Apache-2.0
"""Reads recordings: rosbag2 bag folders with MCAP files, or bare MCAP files, without ROS."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from mcap.records import Channel, Schema, Statistics
from mcap.stream_reader import StreamReader
from numpy.typing import NDArray
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from skydiver_utc.recording.errors import RecordingError
from skydiver_utc.recording.metadata import mcap_files
from skydiver_utc.recording.records import DAMAGE, MAGIC, parts

_ENCAPSULATION_LENGTH = 4

Definitions = frozenset[tuple[str, str]]  # of (type name, ros2msg text)


@dataclass(eq=False)
class RecordedTopic:
    """The messages of one topic, in the order of the file; times in ns."""

    name: str
    type_name: str
    cdr: list[bytes]
    log_times_ns: NDArray[np.int64]
    publish_times_ns: NDArray[np.int64]
    definitions: Definitions = field(repr=False)
    type_hash: str = ""  # RIHS01, empty if unknown
    qos_profiles_yaml: str = field(default="", repr=False)
    # Places of the messages among all of the bag.
    places: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64), repr=False)

    def __len__(self) -> int:
        return len(self.cdr)

    @property
    def messages(self) -> list[Any]:
        """The deserialized messages; bytes that do not fit the type raise `RecordingError`."""
        messages, error = self._decoded
        if error is not None:
            raise self._unreadable(error) from error
        return messages

    @property
    def readable(self) -> list[Any | None]:
        """The deserialized messages, None for each whose bytes do not fit the type."""
        return self._decoded[0]

    @cached_property
    def _decoded(self) -> tuple[list[Any | None], Exception | None]:
        """The messages and the first error."""
        try:
            decode = _decoder(self.type_name, _typestore(self.definitions))
        except (*DAMAGE, SerdeError, TypesysError) as error:
            raise self._unreadable(error) from error
        found: list[Any | None] = []
        first: Exception | None = None
        for cdr in self.cdr:
            try:
                found.append(decode(cdr))
            except (*DAMAGE, SerdeError) as error:
                found.append(None)
                first = first or error
        return found, first

    def _unreadable(self, error: Exception) -> RecordingError:
        return RecordingError(
            f"The messages of {self.name} do not fit the definition of {self.type_name} in the bag"
            f" ({error}): leave this topic out, or record again."
        )


def read_bag(path: Path | str, topics: Iterable[str] | None = None) -> dict[str, RecordedTopic]:
    """The recorded topics by name, all of them or those given.

    `path` is a bag folder or an .mcap file. Messages are deserialized at the first use of `RecordedTopic.messages`.
    An unfinished or damaged bag, one without messages, and a topic that is not in the bag raise `RecordingError`.
    """
    path = Path(path)
    contents = _Contents(None if topics is None else set(topics))
    for file in bag_files(path):
        contents.add(file)
    if contents.message_count == 0:
        raise RecordingError(f"{path} holds no messages: record the run again.")
    recorded = contents.topics()
    for missing in sorted((contents.wanted or set()) - recorded.keys()):
        available = ", ".join(sorted(contents.topic_names))
        raise RecordingError(f"{path} has no topic {missing}: choose from {available}.")
    return recorded


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


@dataclass
class _Column:
    """The messages of one topic while a bag is being read."""

    type_name: str
    type_hash: str
    qos_profiles_yaml: str
    log_times_ns: list[int] = field(default_factory=list)
    publish_times_ns: list[int] = field(default_factory=list)
    cdr: list[bytes] = field(default_factory=list)
    places: list[int] = field(default_factory=list)


class _Contents:
    """The wanted messages of the files read so far."""

    def __init__(self, wanted: set[str] | None) -> None:
        self.wanted = wanted
        self.message_count = 0
        self.topic_names: set[str] = set()
        self._columns: dict[str, _Column] = {}
        self._definitions: set[tuple[str, str]] = set()

    def topics(self) -> dict[str, RecordedTopic]:
        definitions = frozenset(self._definitions)
        return {
            name: RecordedTopic(
                name,
                column.type_name,
                column.cdr,
                np.array(column.log_times_ns, dtype=np.int64),
                np.array(column.publish_times_ns, dtype=np.int64),
                definitions,
                column.type_hash,
                column.qos_profiles_yaml,
                np.array(column.places, dtype=np.int64),
            )
            for name, column in self._columns.items()
        }

    def add(self, path: Path) -> None:
        try:
            with path.open("rb") as stream:
                _check_whole(path, stream)
                self._add_records(stream)
        except OSError as error:
            raise RecordingError(
                f"{path} cannot be read ({error.strerror}): check its permissions."
            ) from error
        except DAMAGE as error:
            raise RecordingError(
                f"{path} is damaged ({error}): save the rest with `skydiver-utc recover {path}` and read that."
            ) from error

    def _add_records(self, stream: BinaryIO) -> None:
        # Schemas and channels stand before their first message and again at the end of the file.
        schemas: dict[int, Schema] = {}
        columns: dict[int, _Column | None] = {}
        found = 0
        for record in StreamReader(stream, emit_chunks=True).records:
            for part in parts(record):
                if isinstance(part, tuple):
                    channel_id, log_time, publish_time, cdr = part
                    found += 1
                    column = columns[channel_id]
                    if column is not None:
                        column.log_times_ns.append(log_time)
                        column.publish_times_ns.append(publish_time)
                        column.cdr.append(cdr)
                        column.places.append(self.message_count + found)
                elif isinstance(part, Schema):
                    schemas[part.id] = part
                elif isinstance(part, Channel) and part.id not in columns:
                    columns[part.id] = self._column(part, schemas.get(part.schema_id))
                elif isinstance(part, Statistics) and part.message_count != found:
                    raise ValueError(f"{found} of {part.message_count} messages found")
        self.message_count += found

    def _column(self, channel: Channel, schema: Schema | None) -> _Column | None:
        """The column of a channel; None if its topic is not wanted."""
        self.topic_names.add(channel.topic)
        if self.wanted is not None and channel.topic not in self.wanted:
            return None
        if schema is None or schema.encoding != "ros2msg" or channel.message_encoding != "cdr":
            raise RecordingError(
                f"The topic {channel.topic} is not a ROS 2 message with a ros2msg definition: choose topics"
                " without it."
            )
        self._definitions.add((schema.name, schema.data.decode()))
        metadata = channel.metadata
        new = _Column(
            schema.name, metadata.get("topic_type_hash", ""), metadata.get("offered_qos_profiles", "")
        )
        column = self._columns.setdefault(channel.topic, new)
        if column.type_name != schema.name:
            raise RecordingError(
                f"The topic {channel.topic} has two types, {column.type_name} and {schema.name}: choose topics"
                " without it."
            )
        return column


def _check_whole(path: Path, stream: BinaryIO) -> None:
    """Raise `RecordingError` unless the file begins and ends as an MCAP file."""
    if stream.read(len(MAGIC)) != MAGIC:
        raise RecordingError(f"{path} is not an MCAP file: give the folder of a recording or its .mcap file.")
    size = path.stat().st_size
    stream.seek(max(size - len(MAGIC), len(MAGIC)))
    if stream.read() != MAGIC:
        raise RecordingError(
            f"{path} has no end, it is still being recorded or its recorder was killed: save its messages"
            f" with `skydiver-utc recover {path}` and read that."
        )
    stream.seek(0)


@lru_cache(maxsize=8)
def _typestore(definitions: Definitions) -> Typestore:
    """The types defined in a bag; cached, because building the decoders takes 0.2 s."""
    store = get_typestore(Stores.EMPTY)
    for type_name, text in sorted(definitions):
        store.register(get_types_from_msg(text, type_name))
    return store


def _decoder(type_name: str, store: Typestore) -> Callable[[bytes], Any]:
    # store.deserialize_cdr refuses the padding that rclpy.serialization leaves at the end of some messages.
    definition = store.get_msgdef(type_name)

    def decode(data: bytes) -> Any:
        little_endian = data[1] & 1
        of_order = definition.deserialize_cdr_le if little_endian else definition.deserialize_cdr_be
        return of_order(data[_ENCAPSULATION_LENGTH:], 0, definition.cls, store)[0]

    return decode
