# SPDX-License-Identifier: Apache-2.0
"""Complete bags from recordings that were cut short or damaged; the original is never changed.

MCAP is written front to back, so that the file of a killed recorder is valid up to its last flush. Chunks have a
checksum: a damaged one is left out.
"""

import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from os.path import lexists
from pathlib import Path
from typing import NamedTuple

from mcap.opcode import Opcode
from mcap.records import Channel, McapRecord, Schema, Statistics

from skydiver_utc.errors import RecordingError
from skydiver_utc.parameters.files import new_folder, write_file
from skydiver_utc.recording.mcap_file import Definition, McapFile, QueuedMessage, StoredTopic, span_with
from skydiver_utc.recording.metadata import METADATA_FILE, message_count, metadata_yaml
from skydiver_utc.recording.reader import bag_files
from skydiver_utc.recording.records import MAGIC, Damaged, is_compressed, parts, records

_FOOTER = struct.Struct("<QQI")  # start of the index, start of its offsets, checksum
_AFTER_INDEX = 4 + len(MAGIC)  # bytes at the end of a file that the checksum is not of: itself, the magic
_OFFSET_OF_CHUNK = slice(16, 24)  # in the index of a chunk


class Loss(NamedTuple):
    """Unreadable bytes of a file, with the log times [ns] of the messages before and after, None at an end."""

    file: str
    byte_count: int
    after_ns: int | None
    before_ns: int | None


@dataclass
class Survey:
    """The readable part of a recording; `whole` if nothing is missing or damaged."""

    path: Path
    counts: Counter[str] = field(default_factory=Counter)  # messages by topic
    losses: list[Loss] = field(default_factory=list)
    lost_messages: int | None = 0  # None: unknown, because a file has no end
    log_span_ns: tuple[int, int] | None = None
    compressed: bool = False  # messages by themselves
    whole: bool = False

    @property
    def message_count(self) -> int:
        """Messages that can be read."""
        return sum(self.counts.values())


def survey(path: Path) -> Survey:
    """Read a bag folder or an .mcap file from end to end; writes nothing."""
    found = Survey(path)
    for file in bag_files(path):
        _survey_file(file, found)
    if not found.losses and found.lost_messages == 0:
        counted = path.is_file() or message_count(path) == found.message_count
        found.whole = counted and all(map(_is_indexed, bag_files(path)))
    return found


def recover(path: Path, folder: Path, beside: dict[str, str] | None = None) -> Survey:
    """Write every readable message of `path` into a new bag `folder`; returns the survey of `path`.

    Messages keep their order, bytes and times; attachments and metadata records are kept, too. `beside`: further
    files of the folder, names and texts. A folder that exists, and a recording without a readable message, raise
    `RecordingError`; after any error there is no folder.
    """
    found = survey(path)
    if found.message_count == 0:
        raise RecordingError(f"{path} holds no message that can be read: record the run again.")
    if lexists(folder):
        raise RecordingError(f"{folder} exists already: choose another name, or move the old one away.")
    with new_folder(folder) as draft:
        name = f"{folder.name}_0.mcap"
        with (draft / name).open("xb") as stream:
            mcap = McapFile(stream)
            mcap.start()
            for file in bag_files(path):
                mcap.write(_copied(file, mcap, _places(file, mcap)))
            mcap.finish()
        metadata = metadata_yaml(name, mcap, "zstd" if found.compressed else "")
        for other, text in {METADATA_FILE: metadata, **(beside or {})}.items():
            write_file(draft / other, text)
    return found


def _places(file: Path, mcap: McapFile) -> dict[int, int]:
    """Add the topics of a file that are not there yet; returns the place of each of its channels."""
    topics = _topics(file)
    for topic in topics.values():
        if topic not in mcap.topics:
            mcap.topics.append(topic)
    return {channel_id: mcap.topics.index(topic) + 1 for channel_id, topic in topics.items()}


def _copied(file: Path, mcap: McapFile, places: dict[int, int]) -> Iterator[QueuedMessage]:
    """The messages of the channels with a place; copies the other records."""
    for part in parts(file):
        if isinstance(part, McapRecord):
            mcap.add_record(part)
        elif not isinstance(part, Damaged) and part[0] in places:
            channel_id, log_time, publish_time, data = part
            yield QueuedMessage(places[channel_id], data, log_time, publish_time)


def _is_indexed(file: Path) -> bool:
    """True where the index has every chunk and the checksum in the footer is that of the index; 0 is no checksum."""
    chunks, indexed, footer = set[bytes](), set[bytes](), b""
    begins = set[int]()  # of the records that may stand in an index
    for offset, _, opcode, data in records(file):
        if opcode != Opcode.MESSAGE:
            begins.add(offset)
        if opcode == Opcode.CHUNK:
            chunks.add(offset.to_bytes(8, "little"))
        elif opcode == Opcode.CHUNK_INDEX:
            indexed.add(data[_OFFSET_OF_CHUNK])
        elif opcode == Opcode.FOOTER:
            footer = data
    if len(footer) != _FOOTER.size or chunks != indexed:
        return False
    start, _, crc = _FOOTER.unpack(footer)
    if start not in begins:
        return False
    with file.open("rb") as stream:
        stream.seek(start)
        return crc in (0, zlib.crc32(stream.read()[:-_AFTER_INDEX]))


def _survey_file(file: Path, found: Survey) -> None:
    topics = _topics(file)
    newest: int | None = None
    unreadable = 0  # bytes since the newest message
    counted: int | None = None  # messages according to the end of the file
    count = 0
    for part in parts(file):
        if isinstance(part, Statistics):
            counted = part.message_count
        elif isinstance(part, Damaged):
            unreadable += part.byte_count
        elif not isinstance(part, McapRecord):
            channel_id, log_time, _, data = part
            if channel_id not in topics:
                unreadable += len(data)
                continue
            if unreadable:
                found.losses.append(Loss(file.name, unreadable, newest, log_time))
                unreadable = 0
            count += 1
            newest = log_time
            found.compressed |= is_compressed(data)
            found.log_span_ns = span_with(found.log_span_ns, log_time)
            found.counts[topics[channel_id].name] += 1
    if unreadable:
        found.losses.append(Loss(file.name, unreadable, newest, None))
    if counted is None or found.lost_messages is None:
        found.lost_messages = None
    else:
        found.lost_messages += counted - count


def _topics(file: Path) -> dict[int, StoredTopic]:
    """Topics by channel id, each from its first record, which is in a chunk and so has a checksum."""
    definitions = {0: Definition()}
    channels: dict[int, Channel] = {}
    for part in parts(file):
        if isinstance(part, Schema):
            definitions.setdefault(part.id, Definition(part.name, part.encoding, part.data))
        elif isinstance(part, Channel):
            channels.setdefault(part.id, part)
    return {
        number: StoredTopic(c.topic, definitions[c.schema_id], c.message_encoding, c.metadata)
        for number, c in channels.items()
        if c.schema_id in definitions
    }
