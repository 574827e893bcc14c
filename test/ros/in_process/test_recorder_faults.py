# SPDX-License-Identifier: Apache-2.0
"""What can go wrong with a recording: each fault is reported, and none stops the run."""

from pathlib import Path

import pytest
from disk import Disk
from own_slots import cart_file
from recorder_stage import NEEDED, Stage
from ros_fixtures import Ros
from std_msgs.msg import String

from skydiver_utc.loop.outcome import Outcome
from skydiver_utc.nodes import topics
from skydiver_utc.recording.reader import read_bag
from skydiver_utc.recording.recovery import recover

pytest_plugins = ("ros_fixtures",)


class Log:
    """What has been logged so far."""

    def __init__(self, capfd: pytest.CaptureFixture[str]) -> None:
        self._capfd = capfd
        self._text = ""

    def lines(self, *words: str) -> list[str]:
        """The lines with all of these words."""
        self._text += self._capfd.readouterr().err
        return [line for line in self._text.splitlines() if all(word in line for word in words)]


@pytest.fixture
def log(capfd: pytest.CaptureFixture[str]) -> Log:
    return Log(capfd)


def test_a_disk_that_runs_full_does_not_stop_the_run(
    ros: Ros, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, log: Log
) -> None:
    Disk(monkeypatch, room=60_000)
    folder = tmp_path / "run"
    given = {"scenario": cart_file(tmp_path), "duration_s": 20.0}
    recorder = ros.node("recorder", given | {"out": str(folder)})
    *_, plant = ros.start(given | {"wait_for_recorder": True}, "reference", "controller", "plant")
    ros.spin_until(lambda: plant.finished and recorder.finished)
    assert plant.run.outcome is Outcome.COMPLETED
    assert recorder.close() == 1
    assert "No space left on device" in recorder.failure
    assert len(log.lines("No space left on device", "continues")) == 1
    assert not (folder / "metadata.yaml").exists()
    monkeypatch.undo()
    recover(folder, tmp_path / "recovered")
    assert 0 < len(read_bag(tmp_path / "recovered")["/skydiver/state"]) < plant.scenario.steps


def test_a_disk_that_blocks_is_reported_and_nothing_is_lost(
    ros: Ros, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, log: Log
) -> None:
    disk = Disk(monkeypatch)
    stage = Stage(ros, tmp_path / "run").all_there()
    disk.blocked = True
    for k in range(20):
        stage.state(k)
    ros.spin_until(lambda: log.lines("disk is slow"))
    disk.blocked = False
    ros.spin_until(lambda: log.lines("disk has caught up"))
    assert len(log.lines("disk is slow")) == 1
    assert len([message for message in stage.recorded() if message.topic == "/skydiver/state"]) == 20


def test_a_topic_of_another_type_is_reported_once_with_its_node(
    ros: Ros, domain: int, tmp_path: Path, log: Log
) -> None:
    stage = Stage(ros, tmp_path / "run")
    elsewhere = Ros(domain)  # DDS does not let one process have both types
    wrong = elsewhere.partner("stray").create_publisher(String, topics.TELEMETRY.name, topics.TELEMETRY.qos)
    ros.spin_until(lambda: log.lines("controller/telemetry", "std_msgs/msg/String"))
    stage.all_there()
    stage.state(0)
    wrong.publish(String(data="no telemetry"))
    checks = stage.others.receive(topics.DIAGNOSTICS)
    ros.spin_until(lambda: len(checks) > 3)  # one a second, as the recorder looks at the types
    (line,) = log.lines("controller/telemetry", "std_msgs/msg/String")
    assert "stray" in line
    assert "/skydiver/controller/telemetry" not in {message.topic for message in stage.recorded()}
    elsewhere.close()


def test_needed_topics_that_nobody_publishes_are_named_until_it_is_ready(
    ros: Ros, tmp_path: Path, log: Log
) -> None:
    stage = Stage(ros, tmp_path / "run")
    missing = (topics.COMMAND, topics.STATE)
    for topic in NEEDED:
        if topic not in missing:
            stage.others.publisher(topic)
    names = {topic.name for topic in NEEDED}

    def waits_for() -> set[str]:
        lines = log.lines("waiting for publishers of ")
        listed = lines[-1].partition("waiting for publishers of ")[2] if lines else ""
        return names & {name.strip() for name in listed.split(",")}

    ros.spin_until(lambda: waits_for() == {topic.name for topic in missing})
    assert not stage.ready
    stage.all_there()
    late = ros.partner("late").receive(topics.RECORDER_READY)
    ros.spin_until(lambda: late)


def test_what_comes_while_a_recorder_is_inactive_is_recorded_after_that_or_at_its_end(
    ros: Ros, tmp_path: Path
) -> None:
    stage = Stage(ros, tmp_path / "run").all_there()
    for k, transition in enumerate(("activate", "cleanup")):
        stage.state(k)
        stage.node.trigger_deactivate()
        stage.send(topics.CHANGES, String(data="{}"))
        ros.spin_for(0.2)
        getattr(stage.node, f"trigger_{transition}")()
    names = [message.topic for message in stage.recorded()]
    assert names.count("/skydiver/state") == names.count("/skydiver/changes") == 2
