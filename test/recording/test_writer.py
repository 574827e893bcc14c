# SPDX-License-Identifier: Apache-2.0
"""The bag writer: what is in the files, when, and what is refused."""

import contextlib
import os
import signal
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
import yaml
from disk import Disk
from mcap.exceptions import EndOfFile
from mcap.reader import make_reader
from mcap.records import Message
from mcap.stream_reader import StreamReader
from refusals import assert_refused

from bags import QOS, START_NS, STRING, messages_in, metadata_of, text_message
from skydiver_utc.errors import RecordingError
from skydiver_utc.recording.metadata import offered_qos, recorded_qos_profiles
from skydiver_utc.recording.reader import read_bag
from skydiver_utc.recording.writer import BagWriter

DT_NS = 4_200_000
PATIENCE_S = 20.0


def test_messages_times_and_sequence_numbers(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        first, second = bag.add_topic("/first", *STRING, ""), bag.add_topic("/second", *STRING, "")
        for k in range(5):
            bag.write(first, text_message(f"a{k}"), START_NS + k * DT_NS, START_NS + k * DT_NS - 7)
        bag.write(second, text_message("b"), START_NS - 1, START_NS - 2)
    with bag.mcap_path.open("rb") as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == "ros2"
        assert len(reader.get_summary().schemas) == 1  # type: ignore[union-attr]
    messages = messages_in(bag.mcap_path)
    assert [m.sequence for m in messages] == [0, 1, 2, 3, 4, 0]
    assert [m.log_time for m in messages] == [*(START_NS + k * DT_NS for k in range(5)), START_NS - 1]
    assert [m.log_time - m.publish_time for m in messages] == [7] * 5 + [1]
    assert [m.data for m in messages[:2]] == [text_message("a0"), text_message("a1")]
    assert [m.channel_id for m in messages] == [first] * 5 + [second]


def test_metadata_has_counts_times_qos_and_no_alias(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "run_1", beside={"scenario.yaml": "name: x"}) as bag:
        channel = bag.add_topic("/text", *STRING, yaml.safe_dump([QOS, QOS]))
        bag.add_topic("/silent", *STRING, "")
        for k in (3, 1, 2):
            bag.write(channel, text_message(str(k)), START_NS + k * DT_NS, START_NS)
    tokens = yaml.scan((bag.folder / "metadata.yaml").read_text())
    assert not [token for token in tokens if isinstance(token, yaml.AliasToken | yaml.AnchorToken)]
    content = metadata_of(bag.folder)
    assert content["version"] == 9
    assert content["storage_identifier"] == "mcap"
    assert content["relative_file_paths"] == ["run_1_0.mcap"]
    assert content["message_count"] == content["files"][0]["message_count"] == 3
    assert content["starting_time"] == {"nanoseconds_since_epoch": START_NS + DT_NS}
    assert content["duration"] == {"nanoseconds": 2 * DT_NS}
    text, silent = content["topics_with_message_count"]
    assert (text["message_count"], silent["message_count"]) == (3, 0)
    assert text["topic_metadata"]["offered_qos_profiles"] == [QOS, QOS]
    assert text["topic_metadata"]["type_description_hash"] == STRING[2]
    assert silent["topic_metadata"]["offered_qos_profiles"] == []
    assert sorted(path.name for path in bag.folder.iterdir()) == [
        "metadata.yaml",
        "run_1_0.mcap",
        "scenario.yaml",
    ]


@pytest.mark.parametrize(
    ("text", "profiles"),
    [
        (offered_qos(10, "RELIABLE", "TRANSIENT_LOCAL"), [QOS]),
        *((text, []) for text in ("", "3", "{}", "{depth: 1}", "[1]", "[{depth: 1}, 1]", "[unclosed")),
    ],
)
def test_qos_profiles_come_back_from_their_text(text: str, profiles: list[object]) -> None:
    assert recorded_qos_profiles(text) == profiles


def test_a_bag_without_messages_is_complete_and_its_parents_are_created(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    for folder in (tmp_path / "bags" / "today" / "bag", tmp_path / "empty"):
        with BagWriter(folder) as bag:
            bag.add_topic("/text", *STRING, "")
        assert messages_in(bag.mcap_path) == []
        content = metadata_of(bag.folder)
        assert (content["message_count"], content["duration"]) == (0, {"nanoseconds": 0})
        assert content["starting_time"] == {"nanoseconds_since_epoch": 2**63 - 1}


@pytest.mark.parametrize("name", ["folder", "file", "file/bag"])
def test_a_folder_that_cannot_be_created_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "folder" / "within").mkdir(parents=True)
    (tmp_path / "file").touch()
    assert_refused(name, BagWriter, tmp_path / name, kind=RecordingError)
    assert [path.name for path in (tmp_path / "folder").iterdir()] == ["within"]


def test_close_twice_and_calls_after_close(tmp_path: Path) -> None:
    bag = BagWriter(tmp_path / "bag")
    channel = bag.add_topic("/text", *STRING, "")
    bag.write(channel, text_message("x"), START_NS, START_NS)
    bag.close()
    content = bag.mcap_path.read_bytes(), (bag.folder / "metadata.yaml").read_bytes()
    bag.close()
    assert_refused("closed", bag.write, channel, b"", 0, 0, kind=RecordingError)
    assert_refused("closed", bag.add_topic, "/late", *STRING, "", kind=RecordingError)
    assert (bag.mcap_path.read_bytes(), (bag.folder / "metadata.yaml").read_bytes()) == content


CHILD = """
import os, signal, sys, time
from pathlib import Path
sys.path[:0] = {path!r}
from bags import STRING, text_message
from skydiver_utc.recording.writer import BagWriter
bag = BagWriter(Path({folder!r}))
channel = bag.add_topic("/text", *STRING, "")
for k in range(50):
    bag.write(channel, text_message(str(k)), k, k)
deadline = time.monotonic() + 3.0
while bag.waiting_bytes and time.monotonic() < deadline:
    time.sleep(0.01)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_killed_process_loses_only_unflushed_messages(tmp_path: Path) -> None:
    code = CHILD.format(path=sys.path, folder=str(tmp_path / "bag"))
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert result.returncode == -signal.SIGKILL, result.stderr
    assert [path.name for path in (tmp_path / "bag").iterdir()] == ["bag_0.mcap"]
    times = []
    with (tmp_path / "bag" / "bag_0.mcap").open("rb") as file, contextlib.suppress(EndOfFile, struct.error):
        for record in StreamReader(file).records:
            times += [record.log_time] if isinstance(record, Message) else []
    assert times == list(range(50))


def test_a_full_disk_is_raised_once_and_the_bag_stays_unfinished(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    Disk(monkeypatch, room=2000)
    bag = BagWriter(tmp_path / "bag", flush_interval_s=0.01)
    channel = bag.add_topic("/text", *STRING, "")

    def record() -> None:
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            bag.write(channel, os.urandom(100), START_NS, START_NS)
            time.sleep(0.002)

    message = assert_refused(("No space left", "skydiver-utc recover"), record, kind=RecordingError)
    assert "OSError" not in message
    bag.close()
    assert not (bag.folder / "metadata.yaml").exists()


def test_a_full_disk_at_the_end_is_raised_by_close(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    disk = Disk(monkeypatch)
    bag = BagWriter(tmp_path / "bag", flush_interval_s=100.0)
    bag.write(bag.add_topic("/text", *STRING, ""), b"", START_NS, START_NS)
    disk.room = 0
    with pytest.raises(RecordingError, match="No space left"):
        bag.close()
    bag.close()


@pytest.mark.parametrize("policy", [os.SCHED_OTHER, os.SCHED_FIFO, os.SCHED_RR])
def test_writing_is_no_real_time_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, policy: int) -> None:
    """Its thread leaves the priority of a real-time process, and does not keep the process from ending."""
    asked: list[object] = []
    monkeypatch.setattr(os, "sched_getscheduler", [policy].__getitem__)
    monkeypatch.setattr(os, "sched_setscheduler", lambda *given: asked.append(given))
    before = set(threading.enumerate())
    with BagWriter(tmp_path / "bag"):
        own = set(threading.enumerate()) - before
    assert [thread.daemon for thread in own] == [True]
    assert asked == ([] if policy == os.SCHED_OTHER else [(0, os.SCHED_OTHER, os.sched_param(0))])


def test_a_bag_is_on_the_disk_before_its_metadata(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sizes: list[int] = []
    monkeypatch.setattr(os, "fsync", lambda file: sizes.append(os.fstat(file).st_size))
    with BagWriter(tmp_path / "bag") as bag:
        bag.write(bag.add_topic("/text", *STRING, ""), text_message("x"), START_NS, START_NS)
    assert sizes == [path.stat().st_size for path in (bag.mcap_path, bag.folder / "metadata.yaml")]


def test_what_waits_is_counted_and_late_after_the_flush_interval(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s = [50.0]
    monkeypatch.setattr(time, "monotonic", lambda: now_s[0])
    with BagWriter(tmp_path / "bag", flush_interval_s=100.0, queue_limit_bytes=1000) as bag:
        channel = bag.add_topic("/text", *STRING, "")
        now_s[0] = 153.0
        assert (bag.waiting_bytes, bag.behind_s) == (0, 0.0)
        written = [bag.write(channel, bytes(size), 0, 0) for size in (600, 401, 400, 1)]
        assert written == [True, False, True, False]
        assert (bag.waiting_bytes, bag.behind_s, bag.dropped) == (1000, 3.0, 2)
        now_s[0] = 149.0
        assert bag.behind_s == 0.0
    assert (bag.waiting_bytes, len(read_bag(bag.folder)["/text"])) == (0, 2)
