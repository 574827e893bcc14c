# SPDX-License-Identifier: Apache-2.0
"""Messages into an open MCAP file, with the counts and times that `metadata.yaml` needs."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import BinaryIO, NamedTuple

from mcap.records import Attachment, McapRecord, Metadata
from mcap.writer import LIBRARY_IDENTIFIER, CompressionType, Writer

# LZ4 makes a recording four times smaller for 0.2 ms of the 1.6 ms of a flush, and every MCAP reader has it; zstd
# takes 1 ms for another sixth.
_COMPRESSION = CompressionType.LZ4
LAST_TIME_NS = 2**63 - 1  # of rosbag2, whose times have a sign


class QueuedMessage(NamedTuple):
    """A message to be written; times in ns."""

    channel_id: int
    cdr: bytes
    log_time_ns: int
    publish_time_ns: int


class Definition(NamedTuple):
    """A message type: its name and its definition, in the language `encoding`; all empty for a topic without one."""

    type_name: str = ""
    encoding: str = ""
    data: bytes = b""


@dataclass
class StoredTopic:
    """A topic of the bag; `metadata` is that of its channel, with rosbag2's type hash and QoS profiles."""

    name: str
    definition: Definition
    encoding: str
    metadata: Mapping[str, str]
    message_count: int = field(default=0, compare=False)
    mcap_channel: int = field(default=0, compare=False)  # from 1, 0 before it is in the file


class McapFile:
    """An MCAP file being written; channel ids are places in `topics`, from 1."""

    def __init__(self, file: BinaryIO) -> None:
        self.topics: list[StoredTopic] = []
        self.log_span_ns: tuple[int, int] | None = None  # first and last log time, None without messages
        self._writer = Writer(file, compression=_COMPRESSION)
        self._schemas: dict[Definition, int] = {Definition(): 0}

    def start(self) -> None:
        """Write the header."""
        self._writer.start(profile="ros2", library=f"skydiver_utc {LIBRARY_IDENTIFIER}")
        self._writer.flush()

    def write(self, messages: Iterable[QueuedMessage]) -> None:
        """Write messages and flush; topics without messages are written too, for recovery."""
        self._register_topics()
        for channel_id, cdr, log_time_ns, publish_time_ns in messages:
            topic = self.topics[channel_id - 1]
            self._writer.add_message(
                topic.mcap_channel, log_time_ns, cdr, publish_time_ns, topic.message_count
            )
            topic.message_count += 1
            self.log_span_ns = span_with(self.log_span_ns, log_time_ns)
        self._writer.flush()

    def add_record(self, record: McapRecord) -> None:
        """Write an attachment or a metadata record; any other kind is the writer's own business."""
        if isinstance(record, Attachment):
            self._writer.add_attachment(
                record.create_time, record.log_time, record.name, record.media_type, record.data
            )
        elif isinstance(record, Metadata):
            self._writer.add_metadata(record.name, record.metadata)

    def finish(self) -> None:
        """Write the index and the footer."""
        self._writer.finish()

    def _register_topics(self) -> None:
        for topic in self.topics:
            if topic.mcap_channel:
                continue
            schema = topic.definition
            if schema not in self._schemas:
                self._schemas[schema] = self._writer.register_schema(*schema)
            topic.mcap_channel = self._writer.register_channel(
                topic.name, topic.encoding, self._schemas[schema], dict(topic.metadata)
            )


def span_with(span_ns: tuple[int, int] | None, time_ns: int) -> tuple[int, int] | None:
    """First and last time with another one; a time that rosbag2 does not know counts as none."""
    if time_ns > LAST_TIME_NS:
        return span_ns
    first, last = span_ns or (time_ns, time_ns)
    return min(first, time_ns), max(last, time_ns)
