# SPDX-License-Identifier: Apache-2.0
"""One bad part of a recording is left out and counted: the rest is read, and recovered byte for byte."""

import struct
import time
import tracemalloc
from pathlib import Path
from typing import Any

import lz4.frame
import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer
from rosbags.rosbag2 import Reader

from bags import START_NS, STRING, Record, Row, chunk_file, rewritten, text_message, write_bag
from skydiver_utc.errors import RecordingError
from skydiver_utc.recording.reader import read_bag
from skydiver_utc.recording.recovery import recover, survey

ROWS = [Row("/a", START_NS + k, START_NS + k, text_message(f"text {k}")) for k in range(20)]
SERVICE_EVENT = b"""service_msgs/ServiceEventInfo info
pkg/srv/Add_Request[<=1] request
================================================================================
MSG: service_msgs/ServiceEventInfo
uint8 REQUEST_SENT = 0
"""


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    return write_bag(tmp_path / "whole", ROWS)


def texts(path: Path) -> list[str]:
    return [message.data for message in read_bag(path)["/a"].readable]


@pytest.mark.parametrize("field", ["log_time", "publish_time"])
@pytest.mark.parametrize(("time_ns", "left_out"), [(2**63 - 1, 0), (2**63, 1), (2**64 - 1000, 1)])
def test_a_message_with_an_impossible_time_is_left_out(
    bag: Path, tmp_path: Path, field: str, time_ns: int, left_out: int
) -> None:
    def edit(record: Record) -> Record:
        if record[2].log_time == START_NS + 7:
            setattr(record[2], field, time_ns)
        return record

    file = rewritten(bag, tmp_path / "run" / "run_0.mcap", edit)
    topic = read_bag(file)["/a"]
    assert (len(topic.readable), topic.left_out) == (20 - left_out, left_out)
    last = START_NS + 19 if left_out or field == "publish_time" else time_ns
    assert topic.log_times_ns.max() == last
    recover(file, tmp_path / "recovered")
    with Reader(tmp_path / "recovered") as reader:
        assert reader.message_count == 20
        assert reader.end_time == last + 1


@pytest.mark.parametrize(
    ("topic", "encoding", "schema"),
    [
        ("/notes", "json", ("note", "jsonschema", b"{}")),
        ("/a", "json", ("note", "jsonschema", b"{}")),
        ("/notes", "json", None),
        ("/a", "json", None),
        ("/notes", "cdr", (STRING[0], "ros2idl", b"module")),
        ("/notes", "cdr", ("pkg/srv/Add_Event", "ros2msg", SERVICE_EVENT)),
        ("/notes", "cdr", ("pkg/msg/Own", "ros2msg", b"\xff\xfe not a definition")),
        ("/notes", "cdr", ("pkg/msg/Own", "ros2msg", b"Own self\n")),
        ("/notes", "cdr", ("pkg/msg/Own", "ros2msg", b"wstring text\n")),
        ("/notes", "cdr", ("pkg/msg/Own", "ros2msg", b"string[99] texts\nstring[2] more\n")),
        ("/notes", "cdr", ("3p/msg/Own", "ros2msg", b"int32 a\n")),
    ],
)
def test_what_is_no_ros_message_is_ignored_and_recovered(
    bag: Path, tmp_path: Path, topic: str, encoding: str, schema: tuple[str, str, bytes] | None
) -> None:
    def attached(writer: Writer) -> None:
        schema_id = 0 if schema is None else writer.register_schema(*schema)
        channel = writer.register_channel(topic, encoding, schema_id, {"offered_qos_profiles": "[" * 3000})
        for k in range(2):
            writer.add_message(channel, START_NS + k, b'{"x": 1}', START_NS + k)
        writer.add_attachment(1, 2, "calibration.txt", "text/plain", b"1 2 3")
        writer.add_metadata("camera", {"serial": "7"})

    file = rewritten(bag, tmp_path / "run" / "run_0.mcap", more=attached)
    assert texts(file) == [f"text {k}" for k in range(20)]
    if topic == "/a":
        assert read_bag(file)["/a"].left_out == 2
    elif schema and schema[1] == "ros2msg":
        assert read_bag(file)["/notes"].readable == [None, None]
    else:
        with pytest.raises(RecordingError, match=r"/notes .*ros2msg"):
            read_bag(file, ["/notes"])
    assert survey(file).whole
    found = recover(file.parent, tmp_path / "recovered")
    assert (found.message_count, found.losses, found.lost_messages) == (22, [], 0)
    again = tmp_path / "recovered"
    assert survey(again).whole
    with (again / "recovered_0.mcap").open("rb") as stream:
        reader = make_reader(stream)
        assert [(a.name, a.data) for a in reader.iter_attachments()] == [("calibration.txt", b"1 2 3")]
        assert [(m.name, m.metadata) for m in reader.iter_metadata()] == [("camera", {"serial": "7"})]
        messages = list(reader.iter_messages())
        assert len(messages) == 22
        kind, other = next((s, c) for s, c, m in messages if m.data == b'{"x": 1}')
        assert (kind and (kind.name, kind.encoding, kind.data)) == schema
        assert (other.topic, other.message_encoding) == (topic, encoding)
        assert other.metadata == {"offered_qos_profiles": "[" * 3000}


@pytest.mark.parametrize(
    "options",
    [
        {"use_chunking": False},
        {"compression": CompressionType.NONE},
        {"compression": CompressionType.ZSTD},
        {"enable_crcs": False},
        {"index_types": IndexType.NONE},
    ],
)
def test_files_of_other_writers_are_read(bag: Path, tmp_path: Path, options: dict[str, Any]) -> None:
    """Those without an index of chunks are whole only once it is made."""
    file = rewritten(bag, tmp_path / "run_0.mcap", **options)
    assert texts(file) == [f"text {k}" for k in range(20)]
    assert survey(file).whole == ("index_types" not in options)


def test_a_damaged_attachment_is_a_loss_of_no_message(bag: Path, tmp_path: Path) -> None:
    def attached(writer: Writer) -> None:
        writer.add_attachment(1, 2, "calibration.txt", "text/plain", b"1 2 3")

    file = rewritten(bag, tmp_path / "run_0.mcap", more=attached)
    whole = file.read_bytes()
    at = whole.index(b"1 2 3")
    for begin, content, fine in ((at, b"1", True), (at, b"X", False), (at + 5, bytes(4), True)):
        file.write_bytes(whole[:begin] + content + whole[begin + len(content) :])
        found = survey(file)
        assert (found.message_count, found.lost_messages) == (20, 0)
        assert found.whole == (not found.losses) == fine
        if not fine:
            with pytest.raises(RecordingError, match="attachment"):
                read_bag(file)


def test_messages_compressed_one_by_one_stay_so(bag: Path, tmp_path: Path) -> None:
    def edit(record: Record) -> Record:
        record[2].data = zstandard.compress(record[2].data)
        return record

    file = rewritten(bag, tmp_path / "run" / "run_0.mcap", edit)
    assert texts(file) == [f"text {k}" for k in range(20)]
    recover(file.parent, tmp_path / "recovered")
    with Reader(tmp_path / "recovered") as reader:  # decompresses as the metadata say
        assert [bytes(data) for _, _, data in reader.messages()] == [row.cdr for row in ROWS]


BOMB = 300_000_000


@pytest.mark.parametrize(("compression", "claim"), [("zstd", BOMB), ("zstd", 1000), ("lz4", 1000)])
def test_a_chunk_that_unpacks_to_very_much_is_damaged(tmp_path: Path, compression: str, claim: int) -> None:
    if compression == "zstd":
        packer = zstandard.ZstdCompressor().compressobj(size=BOMB)
        data = b"".join([packer.compress(bytes(10_000_000)) for _ in range(30)]) + packer.flush()
    else:
        # A frame of repeated blocks: four zero bytes, a match of 64 KB each.
        data = lz4.frame.compress(bytes(50_000_000))
    file = chunk_file(tmp_path / "run" / "run_0.mcap", compression, data, claim)
    tracemalloc.start()
    began = time.monotonic()
    with pytest.raises(RecordingError):
        read_bag(file)
    assert survey(file).losses
    assert time.monotonic() - began < 5.0
    assert tracemalloc.get_traced_memory()[1] < 20_000_000
    tracemalloc.stop()


def packed(opcode: int, content: bytes, beyond: int = 0) -> bytes:
    """A record whose length goes beyond its end."""
    return struct.pack("<BQ", opcode, len(content) + beyond) + content


# A text claims 99 bytes; of what goes beyond the record the library returns what is there.
CUT_SCHEMA = b"".join(
    [struct.pack("<HI", 1, 1), b"x", struct.pack("<I", 7), b"ros2msg", struct.pack("<I", 99), b"int"]
)


@pytest.mark.parametrize(
    ("compression", "data", "size", "losses"),
    [
        ("", b"", 0, 0),
        ("", packed(0x80, b"of a writer's own"), None, 0),
        ("", packed(0x80, b"of a writer's own", beyond=1), None, 1),
        ("", packed(Opcode.SCHEMA, CUT_SCHEMA), None, 1),
        ("zstd", zstandard.ZstdCompressor(write_content_size=False).compress(packed(0x80, b"x")), 10, 0),
        ("zstd", zstandard.ZstdCompressor(write_content_size=False).compress(packed(0x80, b"x")), 11, 1),
        ("lz4", lz4.frame.compress(packed(0x80, b"x")), 9, 1),
        ("lz4", lz4.frame.compress(packed(0x80, b"x")), 10, 0),
        ("lz4", lz4.frame.compress(packed(0x80, b"x")), 11, 1),
    ],
)
def test_a_chunk_has_the_size_and_the_records_that_it_claims(
    tmp_path: Path, compression: str, data: bytes, size: int | None, losses: int
) -> None:
    file = chunk_file(tmp_path / "run_0.mcap", compression, data, len(data) if size is None else size)
    assert len(survey(file).losses) == losses


def test_nothing_is_left_behind_by_a_recovery_that_fails(
    bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (bag / "metadata.yaml").unlink()
    before = sorted(tmp_path.iterdir())

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Writer, "finish", full)
    with pytest.raises(OSError, match="recovered"):
        recover(bag, tmp_path / "recovered")
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize("count", [100, 101])
def test_a_list_of_texts_has_a_largest_length(tmp_path: Path, count: int) -> None:
    definition = f"string[{count}] texts\nint32[999] numbers\n"
    cdr = b"\x00\x01\x00\x00" + struct.pack("<IB3x", 1, 0) * count + bytes(4 * 999)
    write_bag(tmp_path / "bag", [Row("/own", 1, 1, cdr)], schema=("pkg/msg/Own", definition, ""))
    (message,) = read_bag(tmp_path / "bag")["/own"].readable
    assert message is None if count > 100 else message.texts == [""] * count
