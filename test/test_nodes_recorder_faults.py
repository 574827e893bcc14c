"""What can go wrong with a recording: each is told in a sentence, and none stops the flight."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest
from child_processes import children
from ros_fixtures import PATIENCE_S, Processes, Ros, overrides
from std_msgs.msg import String
from test_nodes_recorder import STATE, Stage

from skydiver_utc.analysis.recorded_flight import read_flight
from skydiver_utc.nodes import bag_recorder, topics
from skydiver_utc.nodes.bag_recorder import RecorderNode
from skydiver_utc.nodes.lockstep_controller import ControllerNode
from skydiver_utc.nodes.lockstep_plant import PlantNode
from skydiver_utc.nodes.preview_publisher import ReferenceNode
from skydiver_utc.recording import writer
from skydiver_utc.recording.reader import read_bag
from skydiver_utc.recording.writer import BagWriter
from skydiver_utc.simulation.outcome import Outcome
from skydiver_utc.verbs.recover import recover

pytest_plugins = ("ros_fixtures",)

SCENARIO = "slow_turn_pose_only"


class Disk:
    """Stands between a bag and its file: full after so many bytes, or at a standstill while `stands`."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, room: int | None = None) -> None:
        self.room = room
        self.stands = False
        self._goes = threading.Event()
        create = writer._create_bag
        monkeypatch.setattr(writer, "_create_bag", lambda *places: _File(create(*places), self))

    def wait(self) -> None:
        while self.stands:
            self._goes.wait(0.01)

    def take(self, size: int) -> None:
        if self.room is not None and size > self.room:
            raise OSError(28, "No space left on device")
        if self.room is not None:
            self.room -= size


class _File:
    def __init__(self, file: Any, disk: Disk) -> None:
        self._file = file
        self._disk = disk

    def write(self, data: bytes) -> int:
        self._disk.wait()
        self._disk.take(len(data))
        return int(self._file.write(data))

    def __enter__(self) -> "_File":
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)


@pytest.fixture
def short_patience(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bag_recorder, "_PATIENCE_S", 0.2)


def fly(ros: Ros, folder: Path, duration_s: float = 1.0) -> tuple[PlantNode, RecorderNode]:
    """A recorded flight on this executor, up to the recorder's end."""
    given = overrides(duration_s, scenario=SCENARIO, wait_for_recorder=True)
    recorder = ros.add(
        RecorderNode(ros.context, overrides(duration_s, scenario=SCENARIO, bag_folder=str(folder)))
    )
    plant = ros.add(PlantNode(ros.context, given))
    for kind in (ReferenceNode, ControllerNode):
        ros.add(kind(ros.context, given))
    ros.spin_until(lambda: plant.finished and recorder.finished)
    return plant, recorder


def test_a_disk_that_runs_full_does_not_stop_the_flight(
    ros: Ros, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(bag_recorder, "_FLUSH_INTERVAL_S", 0.05)
    Disk(monkeypatch, room=150_000)  # of some 400 000 bytes that the flight makes
    plant, recorder = fly(ros, tmp_path / "run", 4.0)
    assert plant.outcome is Outcome.COMPLETED
    assert recorder.close() == 1
    told = capfd.readouterr().err
    assert "No space left on device" in recorder.failure
    assert told.count("The flight goes on without a recording") == 1
    assert told.strip().splitlines()[-1].endswith(f"recover {tmp_path / 'run'}` saves what is there.")
    assert not (tmp_path / "run" / "metadata.yaml").exists()
    monkeypatch.undo()
    recover(tmp_path / "run", tmp_path / "recovered", as_json=True)
    assert 0 < len(read_bag(tmp_path / "recovered")["/skydiver/state"]) < plant.scenario.steps


def test_a_disk_that_stands_still_is_told_and_nothing_is_lost(
    ros: Ros, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(bag_recorder, "_SLOW_DISK_S", 0.1)
    disk = Disk(monkeypatch)
    stage = Stage(ros, tmp_path / "run").all_there()
    ros.spin_for(0.5)
    disk.stands = True
    for k in range(50):
        stage.send(topics.STATE, stage.write_state(k, STATE))
    told = ""

    def heard() -> str:
        nonlocal told
        told += capfd.readouterr().err
        return told

    ros.spin_until(lambda: "the disk is slow: it has taken nothing for" in heard())
    assert "the flight goes on" in told
    disk.stands = False
    ros.spin_until(lambda: "the disk has caught up" in heard())
    assert told.count("the disk is slow") == 1
    assert len([message for message in stage.recorded() if message[0] == "/skydiver/state"]) == 50


def test_what_waits_for_a_slow_disk_does_not_fill_the_memory(
    ros: Ros, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(bag_recorder, "_MOST_WAITING_BYTES", 20_000)
    disk = Disk(monkeypatch)
    stage = Stage(ros, tmp_path / "run").all_there()
    disk.stands = True
    sent = [stage.send(topics.STATE, stage.write_state(k, STATE)) for k in range(100)]
    ros.spin_for(0.5)
    disk.stands = False
    kept = [data for topic, _, _, data in stage.recorded() if topic == "/skydiver/state"]
    assert kept == sent[: len(kept)]
    assert len(kept) <= 20_000 // len(sent[0]) + 1
    assert f"the disk was too slow: {100 - len(kept)} messages are not in the bag" in capfd.readouterr().err


def test_a_writer_without_that_limit_drops_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    disk = Disk(monkeypatch)
    with BagWriter(tmp_path / "bag", 0.01) as bag:
        channel = bag.add_topic("/text", "std_msgs/msg/String", "string data\n", "", "")
        disk.stands = True
        assert all(bag.write(channel, bytes(1000), k, k) for k in range(1, 1000))
        assert bag.waiting_bytes > 0
        disk.stands = False
    assert (bag.dropped, bag.waiting_bytes) == (0, 0)
    assert len(read_bag(tmp_path / "bag")["/text"]) == 999


@pytest.mark.usefixtures("short_patience")
def test_a_topic_of_another_type_is_told_once(
    ros: Ros, domain: int, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    stage = Stage(ros, tmp_path / "run")
    elsewhere = Ros(domain)  # DDS does not let one process have both types
    wrong = elsewhere.partner("stranger").create_publisher(String, topics.COMMAND.name, topics.COMMAND.qos)
    told = ""

    def heard() -> str:
        nonlocal told
        wrong.publish(String(data="a command"))
        told += capfd.readouterr().err
        return told

    sentence = "the node stranger publishes command as std_msgs/msg/String, not as sensor_msgs/msg/JointState"
    ros.spin_until(lambda: sentence in heard())
    stage.all_there()
    stage.send(topics.STATE, stage.write_state(0, STATE))
    ros.spin_for(1.0)
    assert heard().count(sentence) == 1
    assert [topic for topic, *_ in stage.recorded()] == ["/skydiver/state"]
    elsewhere.close()


@pytest.mark.usefixtures("short_patience")
def test_topics_that_nobody_publishes_are_named(
    ros: Ros, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    stage = Stage(ros, tmp_path / "run")
    for topic in topics.RECORDED:
        if topic not in (topics.TELEMETRY, topics.OUTCOME):
            stage.others.sends(topic)
    told = ""

    def heard() -> str:
        nonlocal told
        told += capfd.readouterr().err
        return told

    ros.spin_until(lambda: "waiting for publishers of controller/telemetry, outcome\n" in heard())
    stage.all_there()
    heard()
    told = ""
    ros.spin_for(0.6)
    assert "waiting for publishers" not in heard()


def test_what_is_missing_in_the_end_is_counted(
    ros: Ros, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(bag_recorder, "_REPAIR_S", 0.2)
    stage = Stage(ros, tmp_path / "run").all_there()
    stage.send(topics.STATE, stage.write_state(0, STATE))
    stage.send(topics.OUTCOME, String(data=json.dumps({"states": 4})))
    ros.spin_until(lambda: stage.node.finished)
    stage.recorded()
    assert "only 1 of 4 messages of state were recorded" in capfd.readouterr().err


def test_a_folder_that_cannot_be_made_ends_the_recorder_with_one_sentence(
    processes: Processes, tmp_path: Path
) -> None:
    (tmp_path / "file").touch()
    node = processes.start("recorder", overrides(bag_folder=str(tmp_path / "file" / "run")))
    assert node.wait() == 2
    last = node.output.strip().splitlines()[-1]
    assert last.startswith("recorder_node: The bag ")
    assert "choose a folder that you may write to" in last
    assert "Traceback" not in node.output


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs /proc")
def test_a_run_whose_recorder_is_killed_is_flown_to_its_end(domain: int, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    process = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "skydiver_utc.cli",
            "run",
            SCENARIO,
            f"--folder={folder}",
            "--set",
            "duration_s=8",
        ],
        env={**os.environ, "ROS_DOMAIN_ID": str(domain)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + PATIENCE_S
    file = folder / "run_0.mcap"
    while not (file.is_file() and file.stat().st_size > 50_000):
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.01)
    (recorder,) = (pid for pid, command in children(process.pid) if "recorder_node" in command)
    os.kill(recorder, signal.SIGKILL)
    _, stderr = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 1
    assert "the recorder has ended, the flight goes on without a recording" in stderr
    assert "the flight went on to its end, but its recorder failed (signal SIGKILL)" in stderr
    assert f"`skydiver-utc recover {folder}` saves what is there" in stderr
    recover(folder, None, as_json=True)
    assert len(read_flight(tmp_path / "run_recovered").commands) > 50
