# SPDX-License-Identifier: Apache-2.0
"""Messages of rclpy through the bag and back, by three readers; and what the reader refuses."""
# ruff: noqa: E402  (ROS may be absent)

import array
import importlib
import math
import os
import re
import struct
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from refusals import assert_refused
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter
from rosbags.typesys import Stores, get_typestore

from bags import QOS, START_NS, Row, write_bag
from skydiver_utc.errors import RecordingError
from skydiver_utc.recording.reader import read_bag
from skydiver_utc.recording.schemas import message_schema
from skydiver_utc.recording.stamps import leading_stamp_ns
from skydiver_utc.recording.writer import BagWriter

os.environ.setdefault("ROS_PYTHON_CHECK_FIELDS", "1")
serialization = pytest.importorskip("rclpy.serialization")

from builtin_interfaces.msg import Time
from geometry_msgs.msg import TwistStamped
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from skydiver_utc.nodes.topics import RECORDED

DT_NS = 4_200_000
STEPS = 5


class Sent(NamedTuple):
    topic: str
    type_name: str
    message: Any
    log_time_ns: int
    publish_time_ns: int


def filled(kind: Any, rng: np.random.Generator) -> Any:
    """A message with random values in each field, and two entries in each list."""
    message = kind()
    for name, field in kind.get_fields_and_field_types().items():
        setattr(message, name, random_value(field, rng))
    return message


def random_value(field: str, rng: np.random.Generator) -> Any:
    """A value for a field, given its type as rclpy writes it."""
    inner, _, length = field.removeprefix("sequence<").rstrip(">]").partition("[")
    if inner != field:
        return [random_value(inner.partition(",")[0], rng) for _ in range(int(length or 2))]
    if "/" in field:
        package, _, name = field.partition("/")
        return filled(getattr(importlib.import_module(f"{package}.msg"), name), rng)
    small = int(rng.integers(100))
    kinds = {"string": f"{small} \N{DEGREE SIGN}", "boolean": small % 2 == 0, "octet": bytes([small])}
    if field in ("double", "float"):
        return float(rng.choice([*rng.normal(size=8).astype(np.float32), math.inf, math.nan, -0.0]))
    return kinds.get(field, small)


@pytest.fixture(scope="module")
def sent() -> list[Sent]:
    """Some messages of each recorded topic, with random values."""
    rng = np.random.default_rng(1)
    sent = []
    for k in range(STEPS):
        now = START_NS + k * DT_NS
        for topic in RECORDED:
            message = filled(topic.type, rng)
            for stamped in (getattr(message, "header", None), message):
                for name in ("stamp", "clock"):
                    if hasattr(stamped, name):
                        setattr(stamped, name, Time(sec=now // 10**9, nanosec=now % 10**9))
            name = f"/skydiver/{topic.name.lstrip('/')}"
            sent.append(Sent(name, topic.type_name, message, now, now + 1000 + k))
    return sent


@pytest.fixture(scope="module")
def bag(sent, tmp_path_factory) -> Path:
    with BagWriter(tmp_path_factory.mktemp("recording") / "flight") as bag:
        channels: dict[str, int] = {}
        for item in sent:
            if item.topic not in channels:
                schema = message_schema(item.type_name)
                channels[item.topic] = bag.add_topic(item.topic, *schema, yaml.safe_dump([QOS]))
            cdr = serialization.serialize_message(item.message)
            bag.write(channels[item.topic], cdr, item.log_time_ns, item.publish_time_ns)
    return bag.folder


def assert_same(expected: Any, actual: Any) -> None:
    """Field for field, and bit for bit in floats; `expected` is a message of rclpy."""
    if hasattr(expected, "get_fields_and_field_types"):
        for name in expected.get_fields_and_field_types():
            assert_same(getattr(expected, name), getattr(actual, name))
    elif isinstance(expected, float):
        assert struct.pack("<d", expected) == struct.pack("<d", actual)
    elif isinstance(expected, str | int):
        assert expected == actual
    elif isinstance(expected, bytes):
        assert expected == bytes([actual])
    else:
        assert len(expected) == len(actual)
        for one, other in zip(expected, actual, strict=True):
            assert_same(float(one) if isinstance(one, np.floating) else one, other)


def refused(words: str | list[str], *given: Any) -> str:
    return assert_refused(words, read_bag, *given, kind=RecordingError)


def test_rosbags_reads_the_folder_and_the_file(bag, sent):
    with AnyReader([bag]) as reader:
        received = [
            (c, log_time, reader.deserialize(data, c.msgtype)) for c, log_time, data in reader.messages()
        ]
    for item, (connection, log_time, message) in zip(sent, received, strict=True):
        assert (connection.topic, connection.msgtype, log_time) == (
            item.topic,
            item.type_name,
            item.log_time_ns,
        )
        assert_same(item.message, message)
    with Reader(bag) as folder, Reader(bag / "flight_0.mcap") as file:
        for reader in (folder, file):
            assert (reader.message_count, reader.start_time) == (len(sent), START_NS)
            assert reader.end_time == sent[-1].log_time_ns + 1
            assert {topic.msgcount for topic in reader.topics.values()} == {STEPS}
        for listed, stored in zip(folder.connections, file.connections, strict=True):
            assert (listed.topic, listed.msgtype, listed.msgdef, listed.ext) == (
                stored.topic,
                stored.msgtype,
                stored.msgdef,
                stored.ext,
            )
            assert listed.digest == message_schema(listed.msgtype).type_hash
            (qos,) = listed.ext.offered_qos_profiles
            policies = qos.depth, qos.reliability.name, qos.durability.name
            assert policies == (10, "RELIABLE", "TRANSIENT_LOCAL")
        assert folder.ros_distro == os.environ.get("ROS_DISTRO", "jazzy")


@pytest.mark.parametrize("what", ["folder", "file", "folder without metadata"])
def test_own_reader(bag, sent, tmp_path, what):
    path = bag if what == "folder" else bag / "flight_0.mcap"
    if what == "folder without metadata":
        (tmp_path / "any_name.mcap").write_bytes(path.read_bytes())
        path = tmp_path
    recorded = read_bag(path)
    assert sum(map(len, recorded.values())) == len(sent)
    for i, item in enumerate(sent):
        topic, k = recorded[item.topic], i // len(RECORDED)
        assert (topic.name, topic.type_name) == (item.topic, item.type_name)
        assert (topic.log_times_ns[k], topic.publish_times_ns[k]) == (item.log_time_ns, item.publish_time_ns)
        assert_same(item.message, topic.readable[k])


def test_stamps_of_recorded_messages(bag):
    for name, topic in read_bag(bag).items():
        if name.endswith(("clock", "state", "command", "telemetry", "reference", "diagnostics", "rosout")):
            assert [leading_stamp_ns(cdr) for cdr in topic.cdr] == topic.log_times_ns.tolist()


def test_only_wanted_topics(bag):
    recorded = read_bag(bag, ["/skydiver/clock", "/skydiver/command"])
    assert sorted(recorded) == ["/skydiver/clock", "/skydiver/command"]
    refused("/nothing", bag, ["/skydiver/clock", "/nothing"])


def bag_of(folder: Path, name: str, kind: str, *messages: bytes) -> Path:
    """A bag with these serialized messages of one topic."""
    return write_bag(folder, [Row(name, 1, 1, cdr) for cdr in messages], schema=message_schema(kind))


def test_empty_arrays_whose_serialization_has_spare_bytes(tmp_path):
    # rclpy.serialization keeps room to align elements that are not there; what comes over the wire has none.
    point = JointTrajectoryPoint(velocities=array.array("d", [2.5]))
    for sent in (
        JointState(name=["a"], position=array.array("d", [1.5])),
        JointTrajectory(points=[point, point]),
    ):
        name = type(sent).__name__
        kind = f"{type(sent).__module__.partition('.')[0]}/msg/{name}"
        path = bag_of(tmp_path / name, "/sent", kind, serialization.serialize_message(sent))
        assert_same(sent, read_bag(path)["/sent"].readable[0])


def test_big_endian_messages(tmp_path):
    store = get_typestore(Stores.ROS2_JAZZY)
    name = "geometry_msgs/msg/TwistStamped"
    cdr = serialization.serialize_message(filled(TwistStamped, np.random.default_rng(0)))
    swapped = bytes(store.serialize_cdr(store.deserialize_cdr(cdr, name), name, little_endian=False))
    assert swapped[:4] == bytes(4)
    message = read_bag(bag_of(tmp_path / "bag", "/twist", name, swapped))["/twist"].readable[0]
    assert_same(serialization.deserialize_message(cdr, TwistStamped), message)
    assert leading_stamp_ns(swapped) == leading_stamp_ns(cdr)


def bag_of_rosbags(
    folder: Path, storage: StoragePlugin, mode: CompressionMode = CompressionMode.NONE
) -> Path:
    """A bag of one clock at 5 s, by rosbags."""
    writer = RosbagsWriter(folder, version=9, storage_plugin=storage)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        store = get_typestore(Stores.ROS2_JAZZY)
        connection = writer.add_connection("/clock", "rosgraph_msgs/msg/Clock", typestore=store)
        writer.write(connection, 42, serialization.serialize_message(Clock(clock=Time(sec=5))))
    return folder


@pytest.mark.parametrize("mode", [CompressionMode.NONE, CompressionMode.STORAGE, CompressionMode.MESSAGE])
def test_bags_of_rosbags(tmp_path, mode):
    topic = read_bag(bag_of_rosbags(tmp_path / "bag", StoragePlugin.MCAP, mode))["/clock"]
    assert (topic.readable[0].clock.sec, topic.log_times_ns.tolist()) == (5, [42])


def test_bytes_that_are_no_message_do_not_hide_the_others(tmp_path):
    whole = serialization.serialize_message(JointState(name=["a"], position=array.array("d", [1.5])))
    sent = (b"", whole, b"\x00\x01\x00\x00" + b"\xff" * 40, whole[:11], whole)
    topic = read_bag(bag_of(tmp_path / "bag", "/joints", "sensor_msgs/msg/JointState", *sent))["/joints"]
    names = [message and list(message.name) for message in topic.readable]
    assert names == [None, ["a"], None, None, ["a"]]


def test_split_bag(tmp_path):
    """A bag of two files, as `ros2 bag record --max-bag-size` leaves it, and one of them alone."""
    names = ["b_0.mcap", "a_1.mcap"]
    for number, name in enumerate(names):
        clock = serialization.serialize_message(Clock(clock=Time(sec=number)))
        part = bag_of(tmp_path / str(number), "/clock", "rosgraph_msgs/msg/Clock", clock)
        (part / f"{number}_0.mcap").rename(tmp_path / name)
    information = {"rosbag2_bagfile_information": {"relative_file_paths": names}}
    (tmp_path / "metadata.yaml").write_text(yaml.safe_dump(information))
    assert [message.clock.sec for message in read_bag(tmp_path)["/clock"].readable] == [0, 1]
    (tmp_path / "a_1.mcap").unlink()
    refused("a_1.mcap is missing", tmp_path)


def test_what_is_not_a_bag(tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "notes.mcap").write_text("These are notes, not a recording.")
    (tmp_path / "nothing.mcap").touch()
    (tmp_path / "texts").mkdir()
    (tmp_path / "texts" / "notes.txt").touch()
    for name, reason in {
        "absent": "does not exist",
        "empty": "no .mcap file",
        "texts": "no .mcap file",
        "notes.mcap": "not an MCAP file",
        "nothing.mcap": "not an MCAP file",
        "/proc/self/mem": "cannot be read",
    }.items():
        refused([name, reason], tmp_path / name)


@pytest.mark.parametrize(
    "text",
    [
        *("just text", "rosbag2_bagfile_information: 3", "[unclosed", "{a: 1}"),
        "rosbag2_bagfile_information: {storage_identifier: '', relative_file_paths: [1, bag_0.db3]}",
        "rosbag2_bagfile_information: {storage_identifier: mcap, relative_file_paths: [../x/flight_0.mcap]}",
    ],
    ids=lambda text: text[:40],
)
def test_metadata_that_cannot_be_used_do_not_hide_the_file_beside_them(bag, tmp_path, text):
    (tmp_path / "flight_0.mcap").write_bytes((bag / "flight_0.mcap").read_bytes())
    (tmp_path / "metadata.yaml").write_text(text)
    (tmp_path / "older.db3").touch()
    assert read_bag(tmp_path).keys() == read_bag(bag).keys()


def test_a_bag_of_another_storage_names_an_installed_converter(tmp_path):
    """And that program makes a bag that is read."""
    bag_of_rosbags(tmp_path / "bag", StoragePlugin.SQLITE3)
    (command,) = re.findall("`([^`]*)`", refused("bag", tmp_path / "bag"))
    words = command.replace("FOLDER", str(tmp_path / "other")).split()
    subprocess.run([Path(sys.executable).with_name(words[0]), *words[1:]], check=True)
    assert read_bag(tmp_path / "other")["/clock"].readable[0].clock.sec == 5


def test_topics_without_messages(tmp_path):
    with BagWriter(tmp_path / "empty") as writer:
        writer.add_topic("/clock", *message_schema("rosgraph_msgs/msg/Clock"), "")
    refused("no messages", tmp_path / "empty")
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/silent", *message_schema("std_msgs/msg/String"), "")
        clock = writer.add_topic("/clock", *message_schema("rosgraph_msgs/msg/Clock"), "")
        writer.write(clock, serialization.serialize_message(Clock()), 1, 1)
    silent = read_bag(tmp_path / "bag")["/silent"]
    assert (silent.readable, silent.log_times_ns.tolist()) == ([], [])


@pytest.mark.parametrize("kept", [8, 9, 60, 0.3, 0.999])
def test_recording_that_was_cut_short(bag, tmp_path, kept):
    data = (bag / "flight_0.mcap").read_bytes()
    (tmp_path / "flight_0.mcap").write_bytes(data[: kept if isinstance(kept, int) else int(kept * len(data))])
    refused("skydiver-utc recover", tmp_path)


def test_damage_is_never_read_as_data(bag, tmp_path):
    """A flipped byte anywhere is an error, or does not change the messages."""
    data, whole, refused = (bag / "flight_0.mcap").read_bytes(), read_bag(bag), 0
    for position in range(40, len(data), max(1, len(data) // 50)):
        damaged = bytearray(data)
        damaged[position] ^= 0x5A
        (tmp_path / "damaged.mcap").write_bytes(damaged)
        try:
            recorded = read_bag(tmp_path / "damaged.mcap")
        except RecordingError:
            refused += 1
            continue
        for name, topic in whole.items():
            assert (recorded[name].cdr, recorded[name].times_ns) == (topic.cdr, topic.times_ns)
    assert refused > 5


def test_several_chunks_keep_the_order_and_a_lost_one_is_refused(tmp_path):
    with BagWriter(tmp_path / "bag", flush_interval_s=0.001) as writer:
        clock = writer.add_topic("/clock", *message_schema("rosgraph_msgs/msg/Clock"), "")
        for k in range(4000):
            writer.write(clock, serialization.serialize_message(Clock()), k, k)
            while k == 2000 and writer.waiting_bytes:
                time.sleep(0.001)
    assert read_bag(tmp_path / "bag")["/clock"].log_times_ns.tolist() == list(range(4000))
    with writer.mcap_path.open("rb") as stream:
        chunk = make_reader(stream).get_summary().chunk_indexes[1]
    data = bytearray(writer.mcap_path.read_bytes())
    # A record of a kind that nobody knows, and one of a writer's own, to be skipped.
    for opcode in (0x7F, 0x80):
        data[chunk.chunk_start_offset] = opcode
        writer.mcap_path.write_bytes(data)
        refused("skydiver-utc recover", tmp_path / "bag")


def test_two_bags_may_define_one_type_differently(tmp_path):
    for number, text in enumerate(("int32 a\n", "int32 b\n")):
        rows = [Row("/x", 1, 1, b"\x00\x01\x00\x00" + struct.pack("<i", number + 5))]
        write_bag(tmp_path / str(number), rows, schema=("own_msgs/msg/X", text, "RIHS01_0"))
    assert read_bag(tmp_path / "0")["/x"].readable[0].a == 5
    assert read_bag(tmp_path / "1")["/x"].readable[0].b == 6
