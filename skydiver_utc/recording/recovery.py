# SPDX-License-Identifier: Apache-2.0
"""Complete bags from recordings that were cut short or damaged; the original is never changed.

MCAP is written front to back, so that the file of a killed recorder is valid up to its last flush. Chunks have a
checksum: a damaged one is left out.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Channel, Schema, Statistics
from mcap.stream_reader import StreamReader

from skydiver_utc.recording.errors import RecordingError
from skydiver_utc.recording.metadata import METADATA_FILE, message_count
from skydiver_utc.recording.reader import bag_files
from skydiver_utc.recording.records import DAMAGE, MAGIC, RECORD_HEADER, RawMessage, parts
from skydiver_utc.recording.writer import BagWriter

_OPCODES = frozenset(int(opcode) for opcode in Opcode)
# Records with messages or their topics; the others are indexes.
_CONTENTS = frozenset({Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.CHUNK, Opcode.STATISTICS})
_FIRST_PRIVATE_OPCODE = 0x80


class Loss(NamedTuple):
    """Unreadable bytes of a file, with the log times [ns] of the messages before and after, None at an end."""

    file: str
    byte_count: int
    after_ns: int | None
    before_ns: int | None


@dataclass
class Survey:
    """What can be read of a recording; `whole` if nothing is missing or damaged."""

    path: Path
    counts: Counter[str] = field(default_factory=Counter)  # messages by topic
    losses: list[Loss] = field(default_factory=list)
    lost_messages: int | None = 0  # None: unknown, because a file has no end
    log_span_ns: tuple[int, int] | None = None
    whole: bool = False

    @property
    def message_count(self) -> int:
        """Messages that can be read."""
        return sum(self.counts.values())


class _Damaged(NamedTuple):
    """A run of bytes without a readable record."""

    byte_count: int


class _Topic(NamedTuple):
    """The arguments of `BagWriter.add_topic`."""

    name: str
    type_name: str
    schema_text: str
    type_hash: str
    qos_profiles_yaml: str


def survey(path: Path) -> Survey:
    """Read a bag folder or an .mcap file from end to end; writes nothing."""
    found = Survey(path)
    for file in bag_files(path):
        _survey_file(file, found)
    if not found.losses and found.lost_messages == 0:
        counted = path.is_file() or _metadata_counts(path, found.message_count)
        found.whole = counted and _indexed_counts(path) == found.counts
    return found


def recover(path: Path, folder: Path) -> Survey:
    """Write every readable message of `path` into a new bag `folder`; returns the survey of `path`.

    Messages keep their order, bytes and times. A folder that exists, and a recording without a readable message,
    raise `RecordingError`.
    """
    found = survey(path)
    if found.message_count == 0:
        raise RecordingError(f"{path} holds no message that can be read: record the run again.")
    with BagWriter(folder) as bag:
        channels: dict[str, int] = {}
        for file in bag_files(path):
            topics = _topics(file)
            for topic in topics.values():
                if topic.name not in channels:
                    channels[topic.name] = bag.add_topic(*topic)
            for part in _readable_parts(file):
                if isinstance(part, _Damaged) or not isinstance(part, tuple):
                    continue
                channel_id, log_time, publish_time, cdr = part
                if channel_id in topics:
                    bag.write(channels[topics[channel_id].name], cdr, log_time, publish_time)
    return found


def _metadata_counts(folder: Path, count: int) -> bool:
    """True if the folder has metadata with this number of messages."""
    try:
        return (folder / METADATA_FILE).is_file() and message_count(folder) == count
    except RecordingError:
        return False


def _indexed_counts(path: Path) -> Counter[str]:
    """Messages by topic found through the indexes, as other readers find them; empty if an index is damaged."""
    counts: Counter[str] = Counter()
    for file in bag_files(path):
        topics = _topics(file)
        with file.open("rb") as stream:
            try:
                for schema, channel, _ in make_reader(stream).iter_messages(log_time_order=False):
                    if _topic(channel, schema) != topics.get(channel.id):
                        return Counter()
                    counts[channel.topic] += 1
            except (*DAMAGE, OSError, RecordingError):  # OSError: a wrong offset
                return Counter()
    return counts


def _survey_file(file: Path, found: Survey) -> None:
    topics = _topics(file)
    newest: int | None = None
    unreadable = 0  # bytes since the newest message
    counted: int | None = None  # messages according to the end of the file
    count = 0
    for part in _readable_parts(file):
        if isinstance(part, _Damaged):
            unreadable += part.byte_count
        elif isinstance(part, Statistics):
            counted = part.message_count
        elif isinstance(part, tuple):
            channel_id, log_time, _, cdr = part
            if channel_id not in topics:
                unreadable += len(cdr)
                continue
            if unreadable:
                found.losses.append(Loss(file.name, unreadable, newest, log_time))
                unreadable = 0
            count += 1
            newest = log_time
            first, last = found.log_span_ns or (log_time, log_time)
            found.log_span_ns = (min(first, log_time), max(last, log_time))
            found.counts[topics[channel_id].name] += 1
    if unreadable:
        found.losses.append(Loss(file.name, unreadable, newest, None))
    if counted is None or found.lost_messages is None:
        found.lost_messages = None
    else:
        found.lost_messages += counted - count


def _topics(file: Path) -> dict[int, _Topic]:
    """Topics by channel id, each from its first record, which is in a chunk and so has a checksum."""
    schemas: dict[int, Any] = {}
    channels: dict[int, Any] = {}
    for part in _readable_parts(file):
        if isinstance(part, Schema):
            schemas.setdefault(part.id, part)
        elif isinstance(part, Channel):
            channels.setdefault(part.id, part)
    return {
        number: _topic(c, schemas[c.schema_id]) for number, c in channels.items() if c.schema_id in schemas
    }


def _topic(channel: Any, schema: Any) -> _Topic:
    if schema.encoding != "ros2msg" or channel.message_encoding != "cdr":
        raise RecordingError(
            f"The topic {channel.topic} is not a ROS 2 message with a ros2msg definition: this recording comes from"
            " another program, use `mcap recover` (https://mcap.dev)."
        )
    metadata = channel.metadata
    return _Topic(
        channel.topic,
        schema.name,
        schema.data.decode(),
        metadata.get("topic_type_hash", ""),
        metadata.get("offered_qos_profiles", ""),
    )


def _readable_parts(file: Path) -> Iterator[Any | RawMessage | _Damaged]:
    """Every readable record, of complete chunks only, with a `_Damaged` for the bytes between."""
    try:
        with file.open("rb") as stream:
            if stream.read(len(MAGIC)) != MAGIC:
                raise RecordingError(f"{file} is not an MCAP file: give the folder of a recording.")
            size = file.stat().st_size
            while True:
                begin = stream.tell()
                header = stream.read(RECORD_HEADER.size)
                if header in (MAGIC, b""):
                    return
                if len(header) < RECORD_HEADER.size:
                    yield _Damaged(size - begin)
                    return
                opcode, length = RECORD_HEADER.unpack(header)
                if length > size - stream.tell():
                    yield _Damaged(size - begin)
                    return
                yield from _parts_of(opcode, header + stream.read(length))
    except OSError as error:
        raise RecordingError(f"{file} cannot be read ({error.strerror}): check its permissions.") from error


def _parts_of(opcode: int, record: bytes) -> list[Any | RawMessage | _Damaged]:
    """The parts of one record; one `_Damaged` if any of it is damaged."""
    if opcode not in _CONTENTS:
        unknown = opcode not in _OPCODES and opcode < _FIRST_PRIVATE_OPCODE
        return [_Damaged(len(record))] if unknown else []
    try:
        reader = StreamReader(BytesIO(record), skip_magic=True, emit_chunks=True)
        return list(parts(next(reader.records)))
    except DAMAGE:
        return [_Damaged(len(record))]
