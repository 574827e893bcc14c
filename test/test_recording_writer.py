"""The bag writer alone: what lands in the files, when, and what is refused."""

import contextlib
import io
import os
import re
import signal
import struct
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml
from mcap.exceptions import EndOfFile
from mcap.reader import make_reader
from mcap.records import Message
from mcap.stream_reader import StreamReader

from skydiver_utc.recording import writer as writer_module
from skydiver_utc.recording.errors import RecordingError
from skydiver_utc.recording.writer import BagWriter

STRING = ("std_msgs/msg/String", "string data\n", "RIHS01_" + "0" * 64)
START_NS = 1_000_000_000_000
DT_NS = 4_200_000
PATIENCE_S = 20.0

INFINITE = {"sec": 9223372036, "nsec": 854775807}
QOS = {
    "history": "keep_last",
    "depth": 10,
    "reliability": "reliable",
    "durability": "volatile",
    "deadline": INFINITE,
    "lifespan": INFINITE,
    "liveliness": "automatic",
    "liveliness_lease_duration": INFINITE,
    "avoid_ros_namespace_conventions": False,
}


def text_message(text: str) -> bytes:
    data = text.encode() + b"\x00"
    return b"\x00\x01\x00\x00" + struct.pack("<I", len(data)) + data


def add_string_topic(bag: BagWriter, name: str = "/text", qos: str = "") -> int:
    return bag.add_topic(name, *STRING, qos)


def one_sentence(error: pytest.ExceptionInfo) -> str:
    text = str(error.value)
    assert text.endswith(".")
    assert "\n" not in text
    assert not re.search(r"[.!?] [A-Z]", text)
    return text


def stored(path: Path) -> list[Message]:
    with path.open("rb") as stream:
        return [message for _, _, message in make_reader(stream).iter_messages(log_time_order=False)]


def streamed(data: bytes) -> list[Message]:
    """The messages in a file that has no end yet."""
    messages = []
    with contextlib.suppress(EndOfFile, struct.error):
        for record in StreamReader(io.BytesIO(data)).records:
            if isinstance(record, Message):
                messages.append(record)
    return messages


def metadata(bag: BagWriter) -> dict:
    return yaml.safe_load((bag.folder / "metadata.yaml").read_text())["rosbag2_bagfile_information"]


def test_messages_times_and_sequence_numbers(tmp_path):
    with BagWriter(tmp_path / "bag") as bag:
        first, second = add_string_topic(bag, "/first"), add_string_topic(bag, "/second")
        for k in range(5):
            bag.write(first, text_message(f"a{k}"), START_NS + k * DT_NS, START_NS + k * DT_NS - 7)
        bag.write(second, text_message("b"), START_NS - 1, START_NS - 2)
    messages = stored(bag.mcap_path)
    assert [message.sequence for message in messages] == [0, 1, 2, 3, 4, 0]
    assert [message.log_time for message in messages] == [
        *(START_NS + k * DT_NS for k in range(5)),
        START_NS - 1,
    ]
    assert [message.log_time - message.publish_time for message in messages] == [7] * 5 + [1]
    assert [message.data for message in messages[:2]] == [text_message("a0"), text_message("a1")]
    assert messages[0].channel_id == first
    assert messages[5].channel_id == second


def test_profile_encodings_and_channel_metadata(tmp_path):
    qos = yaml.safe_dump([QOS])
    with BagWriter(tmp_path / "bag") as bag:
        add_string_topic(bag, "/one", qos)
        add_string_topic(bag, "/two", qos)
        bag.add_topic("/three", "pkg/msg/Other", "int32 x\n", "RIHS01_f", "")
    with bag.mcap_path.open("rb") as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
    assert [(schema.name, schema.encoding) for schema in summary.schemas.values()] == [
        ("std_msgs/msg/String", "ros2msg"),
        ("pkg/msg/Other", "ros2msg"),
    ]
    channel = summary.channels[1]
    assert (channel.topic, channel.message_encoding) == ("/one", "cdr")
    assert channel.metadata == {"offered_qos_profiles": qos, "topic_type_hash": STRING[2]}


def test_metadata_has_counts_times_qos_and_no_alias(tmp_path):
    with BagWriter(tmp_path / "run_1") as bag:
        channel = add_string_topic(bag, "/text", yaml.safe_dump([QOS, QOS]))
        add_string_topic(bag, "/silent")
        for k in (3, 1, 2):
            bag.write(channel, text_message(str(k)), START_NS + k * DT_NS, START_NS)
    tokens = yaml.scan((bag.folder / "metadata.yaml").read_text())
    assert not [token for token in tokens if isinstance(token, yaml.AliasToken | yaml.AnchorToken)]
    content = metadata(bag)
    assert content["version"] == 9
    assert content["storage_identifier"] == "mcap"
    assert content["relative_file_paths"] == ["run_1_0.mcap"]
    assert content["message_count"] == 3
    assert content["starting_time"] == {"nanoseconds_since_epoch": START_NS + DT_NS}
    assert content["duration"] == {"nanoseconds": 2 * DT_NS}
    text, silent = content["topics_with_message_count"]
    assert (text["message_count"], silent["message_count"]) == (3, 0)
    assert text["topic_metadata"]["offered_qos_profiles"] == [QOS, QOS]
    assert text["topic_metadata"]["type_description_hash"] == STRING[2]
    assert silent["topic_metadata"]["offered_qos_profiles"] == []
    assert content["files"][0]["message_count"] == 3
    assert sorted(path.name for path in bag.folder.iterdir()) == ["metadata.yaml", "run_1_0.mcap"]


def test_bag_without_messages_is_whole(tmp_path):
    with BagWriter(tmp_path / "bag") as bag:
        add_string_topic(bag)
    assert stored(bag.mcap_path) == []
    assert metadata(bag)["message_count"] == 0
    assert metadata(bag)["duration"] == {"nanoseconds": 0}


def test_parents_are_created(tmp_path):
    with BagWriter(tmp_path / "bags" / "today" / "bag") as bag:
        pass
    assert (bag.folder / "metadata.yaml").is_file()


def test_existing_folder_or_file_is_refused(tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").touch()
    for name in ("folder", "file"):
        with pytest.raises(RecordingError, match="exists already") as error:
            BagWriter(tmp_path / name)
        assert "choose another name" in one_sentence(error)
    assert list((tmp_path / "folder").iterdir()) == []


def test_folder_that_cannot_be_created(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    with pytest.raises(RecordingError, match="cannot be created") as error:
        BagWriter(tmp_path / "file" / "bag")
    one_sentence(error)

    def refuse(*_args, **_kwargs):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "mkdir", refuse)
    with pytest.raises(RecordingError, match="Permission denied") as error:
        BagWriter(tmp_path / "bag")
    assert "choose a folder that you may write to" in one_sentence(error)


@pytest.mark.parametrize("interval", [0.0, -1.0, float("nan")])
def test_impossible_flush_interval(tmp_path, interval):
    with pytest.raises(RecordingError, match="flush interval"):
        BagWriter(tmp_path / "bag", flush_interval_s=interval)
    assert not (tmp_path / "bag").exists()


def test_wrong_calls_are_refused_and_leave_no_trace(tmp_path):
    with BagWriter(tmp_path / "bag") as bag:
        channel = add_string_topic(bag)
        with pytest.raises(RecordingError, match="in the bag already"):
            add_string_topic(bag)
        for qos in ("just text", "{a: 1}", "[1, 2]", "[unclosed"):
            with pytest.raises(RecordingError, match="QoS profiles") as error:
                add_string_topic(bag, "/other", qos)
            one_sentence(error)
        for wrong in (0, 2, -1):
            with pytest.raises(RecordingError, match="no channel"):
                bag.write(wrong, b"", START_NS, START_NS)
        for times in ((-1, 0), (0, -1), (2**63, 0)):
            with pytest.raises(RecordingError, match="cannot be stored") as error:
                bag.write(channel, b"", *times)
            one_sentence(error)
        with pytest.raises(TypeError):
            bag.write(channel, b"", 1.5, 0)
        bag.write(channel, text_message("good"), START_NS, START_NS)
    assert len(stored(bag.mcap_path)) == 1
    assert len(metadata(bag)["topics_with_message_count"]) == 1


def test_close_is_idempotent_and_final(tmp_path):
    bag = BagWriter(tmp_path / "bag")
    channel = add_string_topic(bag)
    bag.write(channel, text_message("x"), START_NS, START_NS)
    bag.close()
    content = bag.mcap_path.read_bytes(), (bag.folder / "metadata.yaml").read_bytes()
    bag.close()
    for call in (lambda: bag.write(channel, b"", 0, 0), lambda: add_string_topic(bag, "/late")):
        with pytest.raises(RecordingError, match="is closed"):
            call()
    assert (bag.mcap_path.read_bytes(), (bag.folder / "metadata.yaml").read_bytes()) == content


def test_caller_may_reuse_its_buffer(tmp_path):
    buffer = bytearray(text_message("first"))
    with BagWriter(tmp_path / "bag") as bag:
        channel = add_string_topic(bag)
        bag.write(channel, buffer, START_NS, START_NS)
        buffer[:] = text_message("other")
    assert stored(bag.mcap_path)[0].data == text_message("first")


def test_what_was_flushed_is_in_the_file_before_close(tmp_path):
    bag = BagWriter(tmp_path / "bag", flush_interval_s=0.02)
    try:
        channel = add_string_topic(bag)
        for batch in (1, 2):  # the second batch shows that chunks follow each other
            for k in range(100):
                bag.write(channel, text_message(f"{batch} {k}"), START_NS + k, START_NS)
            deadline = time.monotonic() + PATIENCE_S
            while len(messages := streamed(bag.mcap_path.read_bytes())) < 100 * batch:
                assert time.monotonic() < deadline, f"only {len(messages)} messages in the file"
                time.sleep(0.01)
            assert messages[-1].data == text_message(f"{batch} 99")
        assert not (bag.folder / "metadata.yaml").exists()
    finally:
        bag.close()
    assert len(stored(bag.mcap_path)) == 200


def test_interrupted_recording_is_whole_after_close_in_finally(tmp_path):
    bag = BagWriter(tmp_path / "bag")

    def fly() -> None:
        channel = add_string_topic(bag)
        try:
            for k in range(1000):
                bag.write(channel, text_message(str(k)), START_NS + k, START_NS)
                if k == 700:
                    raise KeyboardInterrupt
        finally:
            bag.close()

    with pytest.raises(KeyboardInterrupt):
        fly()
    assert len(stored(bag.mcap_path)) == metadata(bag)["message_count"] == 701


@pytest.mark.parametrize("delay_s", [0.003, 0.011, 0.023, 0.037, 0.051])
def test_interrupt_at_any_instruction_leaves_whole_records(tmp_path, delay_s):
    """A real signal in the middle of busy writing, with flushes going on all the time."""

    interrupted = False

    def interrupt(_number, _frame):
        nonlocal interrupted
        interrupted = True  # the exception is lost if the signal comes inside a garbage collector's callback
        raise KeyboardInterrupt

    returned = 0
    previous = signal.signal(signal.SIGALRM, interrupt)
    bag = BagWriter(tmp_path / "bag", flush_interval_s=0.001)
    try:
        channel = add_string_topic(bag)
        signal.setitimer(signal.ITIMER_REAL, delay_s)
        while not interrupted:
            bag.write(channel, text_message(str(returned)), START_NS + returned, START_NS)
            returned += 1
    except KeyboardInterrupt:
        pass
    finally:
        signal.signal(signal.SIGALRM, previous)
        bag.close()
    messages = stored(bag.mcap_path)
    assert returned <= len(messages) <= returned + 1
    assert [message.data for message in messages[:returned]] == [
        text_message(str(k)) for k in range(returned)
    ]
    assert metadata(bag)["message_count"] == len(messages)


CHILD = """
import os, signal, sys, time
from pathlib import Path
sys.path[:0] = {path!r}
from test_recording_writer import add_string_topic, text_message
from skydiver_utc.recording.writer import BagWriter
bag = BagWriter(Path({folder!r}), flush_interval_s=0.1)
channel = add_string_topic(bag)
for k in range(50):
    bag.write(channel, text_message(str(k)), k, k)
{end}
"""


def run_child(folder: Path, end: str) -> subprocess.CompletedProcess:
    code = CHILD.format(path=[str(Path(__file__).parent), *sys.path], folder=str(folder), end=end)
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False
    )


def test_killed_process_loses_only_what_was_not_flushed(tmp_path):
    late = "bag.write(channel, text_message('lost'), 99, 99)"
    result = run_child(tmp_path / "bag", f"time.sleep(2); {late}; os.kill(os.getpid(), signal.SIGKILL)")
    assert result.returncode == -signal.SIGKILL, result.stderr
    assert [path.name for path in (tmp_path / "bag").iterdir()] == ["bag_0.mcap"]
    data = (tmp_path / "bag" / "bag_0.mcap").read_bytes()
    assert [message.log_time for message in streamed(data)][:50] == list(range(50))


def test_process_that_ends_without_close_leaves_a_whole_bag(tmp_path):
    result = run_child(tmp_path / "bag", "sys.exit(3)")
    assert result.returncode == 3, result.stderr
    assert len(stored(tmp_path / "bag" / "bag_0.mcap")) == 50
    assert (tmp_path / "bag" / "metadata.yaml").is_file()


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
def test_full_disk_is_told_once_and_the_bag_counts_as_unfinished(tmp_path, monkeypatch):
    def on_a_full_disk(folder, _path):
        folder.mkdir()
        return open("/dev/full", "wb")

    monkeypatch.setattr(writer_module, "_create_bag", on_a_full_disk)
    bag = BagWriter(tmp_path / "bag", flush_interval_s=0.01)

    def record_until_refused():
        channel = add_string_topic(bag)
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            bag.write(channel, text_message("x"), START_NS, START_NS)
            time.sleep(0.005)

    with pytest.raises(RecordingError, match="No space left") as error:
        record_until_refused()
    assert "make room" in one_sentence(error)
    bag.close()
    assert not (bag.folder / "metadata.yaml").exists()


def test_full_disk_is_told_by_close(tmp_path, monkeypatch):
    def fail(*_args):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(writer_module, "write_whole", fail)
    bag = BagWriter(tmp_path / "bag")
    with pytest.raises(RecordingError, match="No space left"):
        bag.close()
    bag.close()
