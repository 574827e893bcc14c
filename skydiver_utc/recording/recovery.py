"""Whole bags out of recordings that were cut short or damaged; what was there before is never touched.

MCAP is written front to back, so that a recorder that was killed leaves a file that is good up to its last flush.
Chunks carry a checksum: one that is damaged is left out, never read as data.
"""

import struct
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
from skydiver_utc.recording.records import DAMAGE, MAGIC, RawMessage, parts
from skydiver_utc.recording.writer import BagWriter

_RECORD_HEADER = struct.Struct("<BQ")  # opcode, length
_OPCODES = frozenset(int(opcode) for opcode in Opcode)
# What messages are in; the rest is indexes.
_CONTENTS = frozenset({Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.CHUNK, Opcode.STATISTICS})
_FIRST_PRIVATE_OPCODE = 0x80


class Loss(NamedTuple):
    """Bytes of a file that hold no readable record, with the log times [ns] of the messages around them."""

    file: str
    byte_count: int
    after_ns: int | None  # None: nothing before it
    before_ns: int | None  # None: nothing after it


@dataclass
class Survey:
    """What a recording holds and lacks; `whole` when it is a bag that lacks nothing."""

    path: Path
    counts: Counter[str] = field(default_factory=Counter)  # messages by topic
    losses: list[Loss] = field(default_factory=list)
    lost_messages: int | None = 0  # None: the file has no end that would tell
    log_span_ns: tuple[int, int] | None = None
    whole: bool = False

    @property
    def message_count(self) -> int:
        """Messages that can be read."""
        return sum(self.counts.values())


@dataclass(frozen=True)
class _Damaged:
    """Stands for so many bytes without a readable record."""

    byte_count: int


class _Topic(NamedTuple):
    name: str
    type_name: str
    schema_text: str
    type_hash: str
    qos_profiles_yaml: str


def survey(path: Path) -> Survey:
    """Read a recording, a bag folder or an .mcap file, from end to end; changes nothing."""
    found = Survey(path)
    for file in bag_files(path):
        _survey_file(file, found)
    if not found.losses and found.lost_messages == 0:
        listed = path.is_file() or _lists(path, found.message_count)
        found.whole = listed and _indexed_counts(path) == found.counts
    return found


def recover(path: Path, folder: Path) -> Survey:
    """Write all that can be read at `path` into a new bag `folder`; returns the survey of what was read.

    Messages keep their order, bytes and times. A folder that exists, and a recording in which nothing can be
    read, raise `RecordingError`.
    """
    found = survey(path)
    if found.message_count == 0:
        raise RecordingError(f"{path} holds no message that can be read: record the flight again.")
    with BagWriter(folder) as bag:
        channels: dict[str, int] = {}
        for file in bag_files(path):
            topics = _topics(file)
            for topic in topics.values():
                if topic.name not in channels:
                    channels[topic.name] = bag.add_topic(*topic)
            for part in _salvaged(file):
                if isinstance(part, tuple):
                    channel_id, log_time, publish_time, cdr = part
                    if channel_id in topics:
                        bag.write(channels[topics[channel_id].name], cdr, log_time, publish_time)
    return found


def _lists(folder: Path, count: int) -> bool:
    """True when the folder has metadata with this number of messages."""
    if not (folder / METADATA_FILE).is_file():
        return False
    try:
        return message_count(folder) == count
    except RecordingError:
        return False


def _indexed_counts(path: Path) -> Counter[str]:
    """Messages by topic that are found by way of the indexes, as other readers do; none where those are damaged."""
    counts: Counter[str] = Counter()
    for file in bag_files(path):
        topics = _topics(file)
        with file.open("rb") as stream:
            try:
                for schema, channel, _ in make_reader(stream).iter_messages(log_time_order=False):
                    if _topic(channel, schema) != topics.get(channel.id):
                        return Counter()
                    counts[channel.topic] += 1
            except (*DAMAGE, OSError, RecordingError):  # OSError comes of an offset that is not true
                return Counter()
    return counts


def _survey_file(file: Path, found: Survey) -> None:
    topics = _topics(file)
    newest: int | None = None
    open_losses: list[int] = []  # bytes of losses since the newest message
    told: int | None = None
    count = 0

    def close_losses(before_ns: int | None) -> None:
        if open_losses:
            found.losses.append(Loss(file.name, sum(open_losses), newest, before_ns))
            open_losses.clear()

    for part in _salvaged(file):
        if isinstance(part, _Damaged):
            open_losses.append(part.byte_count)
        elif isinstance(part, tuple):
            channel_id, log_time, _, cdr = part
            if channel_id not in topics:
                open_losses.append(len(cdr))
                continue
            close_losses(log_time)
            count += 1
            newest = log_time
            first, last = found.log_span_ns or (log_time, log_time)
            found.log_span_ns = (min(first, log_time), max(last, log_time))
            found.counts[topics[channel_id].name] += 1
        elif isinstance(part, Statistics):
            told = part.message_count
    close_losses(None)
    if told is None or found.lost_messages is None:
        found.lost_messages = None
    else:
        found.lost_messages += told - count


def _topics(file: Path) -> dict[int, _Topic]:
    """Topics by channel id, from where they are announced first: of all places, chunks have a checksum."""
    schemas: dict[int, Any] = {}
    channels: dict[int, Any] = {}
    for part in _salvaged(file):
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
            f"The topic {channel.topic} is not a ROS 2 message with a ros2msg definition, so this is no recording"
            " of this package: use `mcap recover` (https://mcap.dev)."
        )
    metadata = channel.metadata
    return _Topic(
        channel.topic,
        schema.name,
        schema.data.decode(),
        metadata.get("topic_type_hash", ""),
        metadata.get("offered_qos_profiles", ""),
    )


def _salvaged(file: Path) -> Iterator[Any | RawMessage | _Damaged]:
    """Every record that can be read, those of whole chunks only; a `_Damaged` for what lies between them."""
    try:
        with file.open("rb") as stream:
            if stream.read(len(MAGIC)) != MAGIC:
                raise RecordingError(f"{file} is not an MCAP file: give the folder of a recording.")
            size = file.stat().st_size
            while True:
                header = stream.read(_RECORD_HEADER.size)
                if header == MAGIC:
                    return
                begin = stream.tell() - len(header)
                if len(header) < _RECORD_HEADER.size:
                    if header:
                        yield _Damaged(size - begin)
                    return
                opcode, length = _RECORD_HEADER.unpack(header)
                if length > size - stream.tell():
                    yield _Damaged(size - begin)
                    return
                yield from _parts_of(opcode, header + stream.read(length))
    except OSError as error:
        raise RecordingError(f"{file} cannot be read ({error.strerror}): check that you may.") from error


def _parts_of(opcode: int, record: bytes) -> Iterator[Any | RawMessage | _Damaged]:
    """The parts of one record, all of them or none."""
    if opcode not in _CONTENTS:
        if opcode not in _OPCODES and opcode < _FIRST_PRIVATE_OPCODE:
            yield _Damaged(len(record))
        return
    try:
        reader = StreamReader(BytesIO(record), skip_magic=True, emit_chunks=True)
        found = list(parts(next(reader.records)))
    except DAMAGE:
        yield _Damaged(len(record))
        return
    yield from found
