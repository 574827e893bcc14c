# SPDX-License-Identifier: Apache-2.0
"""The recorder node against a partner that publishes everything else."""

import json
import time
from pathlib import Path

import numpy as np
import pytest
from recorder_stage import NEEDED, Stage
from ros_fixtures import Ros, overrides
from std_msgs.msg import String

from bags import metadata_of, stored
from skydiver_utc.messages import outcome_text
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.topics import RECORDED, Topic
from skydiver_utc.parameters import load_scenario

pytest_plugins = ("ros_fixtures",)


@pytest.fixture
def stage(ros: Ros, tmp_path: Path) -> Stage:
    return Stage(ros, tmp_path / "bag")


def test_messages_are_recorded_byte_for_byte_at_simulated_time_with_scenario_and_versions(
    stage: Stage,
) -> None:
    stage.all_there()
    for k in range(5):
        stage.send(topics.CLOCK, stage.stamped(topics.CLOCK, k))
        stage.state(k)
        stage.send(topics.COMMAND, stage.stamped(topics.COMMAND, k))
    recorded = stage.recorded()
    assert sorted((message.topic, message.cdr) for message in recorded) == sorted(stage.sent)
    states = [message for message in recorded if message.topic == "/skydiver/state"]
    assert [message.log_time for message in states] == [stage.node.scenario.stamp_ns(k) for k in range(5)]
    log_times = [message.log_time for message in recorded]
    assert log_times == sorted(log_times)
    published = [message.publish_time for message in states]
    assert published == sorted(published)
    assert abs(published[0] - time.time_ns()) < 600e9
    names = {path.name for path in stage.folder.iterdir()}
    assert names == {"bag_0.mcap", "metadata.yaml", "scenario.yaml", "versions.json"}
    assert load_scenario(str(stage.folder / "scenario.yaml")) == stage.node.scenario
    versions = json.loads((stage.folder / "versions.json").read_text())
    assert (versions["rmw"], versions["numpy"]) == ("rmw_fastrtps_cpp", np.__version__)
    listed = metadata_of(stage.folder)["topics_with_message_count"]
    profiles = {t["topic_metadata"]["name"]: t["topic_metadata"]["offered_qos_profiles"][0] for t in listed}
    assert len(profiles) == len(RECORDED) - 1  # without a publisher the estimate has no type
    assert profiles["/skydiver/outcome"]["durability"] == "transient_local"
    assert profiles["/skydiver/state"]["durability"] == "volatile"


def test_without_a_stamp_of_the_run_a_message_gets_the_newest_time_of_clock_and_state(stage: Stage) -> None:
    stage.all_there()
    stage.state(7)
    stage.send(topics.COMMAND, stage.stamped(topics.COMMAND, 20))
    for seconds in (0, 1_800_000_000):
        for topic in (topics.STATE, topics.COMMAND):
            message = topic.type()
            message.header.stamp.sec = seconds
            stage.send(topic, message)
    stage.ros.spin_until(lambda: stage.node.refusals.counts["stamp"] == 4)
    stage.send(topics.CHANGES, String(data="{}"))
    stage.state(9)
    stage.outcome(10, outcome="aborted")
    stage.ros.spin_until(lambda: stage.node.done)
    recorded = [(message.topic, message.log_time) for message in stage.recorded()]
    at_7, at_9, at_20 = map(stage.node.scenario.stamp_ns, (7, 9, 20))
    for name, counts in (
        ("scenario", (1, 0, 0)),
        ("state", (3, 1, 0)),
        ("command", (2, 0, 1)),
        ("outcome", (0, 1, 0)),
    ):
        found = tuple(recorded.count((f"/skydiver/{name}", at)) for at in (at_7, at_9, at_20))
        assert found == counts, name
    assert dict(recorded)["/skydiver/changes"] in (at_7, at_9)


def test_a_vehicle_has_its_own_time(stage: Stage) -> None:
    now_ns = stage.node.scenario.stamp_ns(0) + 10**16
    for i in range(3):
        message = topics.STATE.type()
        stamp_ns = now_ns + 4_000_000 * i
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
        stage.send(topics.STATE, message)
        stage.ros.spin_until(lambda: stage.node.newest_step() > 0)
    assert [message.log_time for message in stage.recorded()] == [now_ns + 4_000_000 * i for i in range(3)]
    assert stage.node.refusals.counts == {}


@pytest.mark.parametrize("last", NEEDED, ids=lambda topic: topic.name)
def test_it_is_not_ready_while_one_needed_topic_is_missing(stage: Stage, last: Topic) -> None:
    for topic in NEEDED:
        if topic is not last:
            stage.others.publisher(topic)
    stage.ros.spin_until(lambda: stage.node.missing().endswith(f" of {last.name}"))
    stage.ros.spin_for(0.1)
    assert stage.ready == []
    stage.others.publisher(last)
    stage.ros.spin_until(lambda: stage.ready)


def test_a_clock_that_is_set_back_changes_nothing(
    ros: Ros, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_ns = time.time_ns
    monkeypatch.setattr(time, "time_ns", lambda: now_ns() + 3600 * 10**9)
    stage = Stage(ros, tmp_path / "bag").all_there()
    stage.state(0)
    stage.outcome(1)
    stage.ros.spin_until(lambda: stage.node.finished)


def test_lost_messages_of_an_aborted_run_are_counted_and_not_waited_for_but_logs_are_recorded(
    stage: Stage, capfd: pytest.CaptureFixture[str]
) -> None:
    stage.all_there()
    stage.state(0)
    stage.ros.spin_until(lambda: stage.others.count_subscribers("/rosout"))
    stage.others.get_logger().info("a sentence")
    stage.outcome(2, outcome="aborted")
    stage.ros.spin_until(lambda: stage.node.finished)
    began = time.monotonic()
    stage.node.close()
    assert "1 of 2 messages of state" in capfd.readouterr().err
    # Of a completed run they are waited for 10 s.
    assert time.monotonic() - began < 5.0
    logs = [message.cdr for message in stored(stage.folder) if message.topic == "/rosout"]
    assert any(b"a sentence" in cdr for cdr in logs)


def test_an_outcome_from_before_the_recording_does_not_end_it(ros: Ros, tmp_path: Path) -> None:
    earlier = ros.partner("earlier")
    text = outcome_text("r", "completed", "", wall_time_s=1.0, states=10)
    earlier.publisher(topics.OUTCOME).publish(String(data=text))
    stage = Stage(ros, tmp_path / "bag").all_there()
    ros.spin_until(lambda: stage.node.refusals.counts["earlier"])
    stage.state(0)
    assert not stage.node.finished
    assert "/skydiver/outcome" not in {message.topic for message in stage.recorded()}


OF_ANOTHER = outcome_text("another", "completed", "", wall_time_s=1.0, states=1)


def test_only_an_outcome_of_its_run_ends_the_recording(stage: Stage) -> None:
    stage.all_there()
    stage.state(0)
    for message in (String(data=OF_ANOTHER), String(data="[]"), b"\0\1\0\0\xff\xff\xff\x7f"):
        stage.send(topics.OUTCOME, message)
    stage.ros.spin_until(lambda: stage.node.refusals.counts.total() == 3)
    stage.state(1)
    assert not stage.node.finished
    stage.outcome(2)
    stage.ros.spin_until(lambda: stage.node.finished)


@pytest.mark.parametrize(
    ("steps", "states", "lost"),
    [((0, 2), 3, [" 2 of 3 "]), ((6, 7), 8, [])],  # the second comes into a run
)
def test_states_that_are_missing_at_the_end_are_counted_and_may_come(
    stage: Stage, steps: tuple[int, ...], states: int, lost: list[str]
) -> None:
    def missing() -> list[str]:
        return [line for line in stage.node.not_in_bag() if line.endswith("of state were recorded")]

    stage.all_there()
    for k in steps:
        stage.state(k)
    stage.outcome(states)
    stage.ros.spin_until(lambda: stage.node.finished)
    assert [words in line for words, line in zip(lost, missing(), strict=True)] == [True] * len(lost)
    stage.state(1)
    stage.ros.spin_until(lambda: not missing())


def test_without_a_name_the_folder_is_named_by_time_and_scenario(
    ros: Ros, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    node = ros.node("recorder", overrides())
    node.close()
    (folder,) = (tmp_path / "bags").iterdir()
    assert folder.name[8] == "T"
    assert folder.name.endswith("Z_fast_turn_unknown_dynamics")
