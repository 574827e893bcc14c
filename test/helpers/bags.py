# SPDX-License-Identifier: Apache-2.0
"""Bags for tests, written without ROS, and what independent readers find in them."""

import copy
import struct
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import yaml
from mcap.data_stream import RecordBuilder
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, Header, Message, Schema
from mcap.writer import MCAP0_MAGIC, Writer

from skydiver_utc.recording.writer import BagWriter

STRING = ("std_msgs/msg/String", "string data\n", "RIHS01_" + "0" * 64)
START_NS = 1_700_000_000_000_000_000
INFINITE = {"sec": 9223372036, "nsec": 854775807}
QOS = {
    "history": "keep_last",
    "depth": 10,
    "reliability": "reliable",
    "durability": "transient_local",
    "deadline": INFINITE,
    "lifespan": INFINITE,
    "liveliness": "automatic",
    "liveliness_lease_duration": INFINITE,
    "avoid_ros_namespace_conventions": False,
}


class Row(NamedTuple):
    """One message; times in ns."""

    topic: str
    log_time: int
    publish_time: int
    cdr: bytes


def text_message(text: str) -> bytes:
    """A serialized std_msgs/String."""
    data = text.encode() + b"\x00"
    return b"\x00\x01\x00\x00" + struct.pack("<I", len(data)) + data


def write_bag(
    folder: Path, rows: Sequence[Row], qos: str = "", schema: tuple[str, str, str] = STRING
) -> Path:
    """A bag of messages of one type, text unless another schema is given."""
    with BagWriter(folder) as bag:
        channels = {name: bag.add_topic(name, *schema, qos) for name in dict.fromkeys(r.topic for r in rows)}
        for row in rows:
            bag.write(channels[row.topic], row.cdr, row.log_time, row.publish_time)
    return folder


Record = tuple[Schema | None, Channel, Message]


def records_in(path: Path) -> list[Record]:
    """The messages of an MCAP file in the order of the file, read by the mcap library."""
    with path.open("rb") as stream:
        return list(make_reader(stream, validate_crcs=True).iter_messages(log_time_order=False))


def messages_in(path: Path) -> list[Message]:
    return [message for _, _, message in records_in(path)]


def stored(folder: Path) -> list[Row]:
    """The messages of a bag folder in the order of its file."""
    (path,) = folder.glob("*.mcap")
    return [Row(c.topic, m.log_time, m.publish_time, m.data) for _, c, m in records_in(path)]


def metadata_of(folder: Path) -> dict[str, Any]:
    """The content of metadata.yaml."""
    content = yaml.safe_load((folder / "metadata.yaml").read_text())
    return dict(content["rosbag2_bagfile_information"])


def rewritten(
    source: Path,
    target: Path,
    edit: Callable[[Record], Record] = lambda record: record,
    more: Callable[[Writer], object] = lambda writer: None,
    **options: Any,
) -> Path:
    """The MCAP file of a bag written again, each record after `edit`, by the library's writer and its options."""
    (file,) = source.glob("*.mcap")
    target.parent.mkdir(parents=True, exist_ok=True)
    with target.open("wb") as out:
        writer = Writer(out, **options)
        writer.start(profile="ros2")
        channels: dict[Any, int] = {}
        for record in records_in(file):
            schema, channel, message = edit(copy.deepcopy(record))
            key = channel.topic, channel.message_encoding, schema and schema.data
            if key not in channels:
                schema_id = schema and writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[key] = writer.register_channel(
                    channel.topic, channel.message_encoding, schema_id or 0, channel.metadata
                )
            writer.add_message(
                channels[key], message.log_time, message.data, message.publish_time, message.sequence
            )
        more(writer)
        writer.finish()
    return target


def chunk_file(path: Path, compression: str, data: bytes, size: int) -> Path:
    """An MCAP file with one chunk of these compressed bytes, which claims a size; no index."""
    builder = RecordBuilder()
    Header("ros2", "test").write(builder)
    Chunk(compression, data, 0, 0, 0, size).write(builder)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(MCAP0_MAGIC + builder.end() + MCAP0_MAGIC)
    return path
