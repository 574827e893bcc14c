"""The recorder node against a partner that publishes everything."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from rclpy.serialization import deserialize_message, serialize_message
from ros_fixtures import Partner, Processes, Ros, overrides
from std_msgs.msg import String

from skydiver_utc.nodes import bag_recorder, topics
from skydiver_utc.nodes.bag_recorder import RecorderNode
from skydiver_utc.nodes.messages import ClockWriter, NamedValuesWriter, StateWriter
from skydiver_utc.nodes.topics import RECORDED, Topic
from skydiver_utc.parameters import load_scenario
from skydiver_utc.plant.skydiver import CONTROL_NAMES
from skydiver_utc.recording.errors import RecordingError

pytest_plugins = ("ros_fixtures",)

STATE = np.array([0, 0, 4000.0, 0, 0, 0, 1, 0, 0, -58.0, 0, 0, 0])


class Stage:
    """A recorder node, and a partner that plays all others."""

    def __init__(self, ros: Ros, folder: Path, **parameters: object) -> None:
        self.ros = ros
        self.folder = folder
        given = overrides(bag_folder=str(folder), **parameters)
        self.node: RecorderNode = ros.add(RecorderNode(ros.context, given))
        self.others: Partner = ros.partner("others")
        self.grid = self.node.grid
        self.write_state = StateWriter(self.grid).fill

    def all_there(self) -> "Stage":
        """Publish every topic and wait until the recorder says that it hears them."""
        for topic in RECORDED:
            self.others.sends(topic)
        ready = self.others.hear(topics.RECORDER_READY)
        self.ros.spin_until(lambda: ready)
        assert ready[0].data == str(self.folder)
        return self

    def send(self, topic: Topic, message: Any) -> bytes:
        """Send these very bytes: padding is random, so that no two serializations need be equal."""
        data = bytes(serialize_message(message))
        self.others.sends(topic).publish(data)
        return data

    def recorded(self) -> list[tuple[str, int, int, bytes]]:
        """Close the recorder; topic, times and bytes of what others sent, in the order of the file."""
        self.node.close()
        return [message for message in messages_of(self.folder) if message[0] != topics.DIAGNOSTICS.name]


def messages_of(folder: Path) -> Iterator[tuple[str, int, int, bytes]]:
    (path,) = folder.glob("*.mcap")
    with path.open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages(log_time_order=False):
            yield channel.topic, message.log_time, message.publish_time, message.data


@pytest.fixture
def brief_repair(monkeypatch: pytest.MonkeyPatch) -> None:
    """What has not come with the outcome is waited for as briefly as a test can be certain of."""
    monkeypatch.setattr(bag_recorder, "_REPAIR_S", 0.2)


@pytest.fixture
def stage(ros: Ros, tmp_path: Path) -> Stage:
    return Stage(ros, tmp_path / "bag")


def test_messages_are_kept_byte_for_byte_at_simulated_time(stage: Stage) -> None:
    stage.all_there()
    sent = []
    for k in range(5):
        sent.append(
            ("/skydiver/state", stage.send(topics.STATE, stage.write_state(k, STATE + k * (STATE != 1))))
        )
        sent.append(("/clock", stage.send(topics.CLOCK, ClockWriter(stage.grid).fill(k))))
        command = NamedValuesWriter(stage.grid, CONTROL_NAMES).fill(k, np.arange(4.0))
        sent.append(("/skydiver/command", stage.send(topics.COMMAND, command)))
    stage.ros.spin_for(0.3)
    recorded = stage.recorded()
    assert sorted((topic, data) for topic, _, _, data in recorded) == sorted(sent)
    states = [message for message in recorded if message[0] == "/skydiver/state"]
    assert [log for _, log, _, _ in states] == [stage.node.scenario.stamp_ns(k) for k in range(5)]
    assert [log for _, log, _, _ in recorded] == sorted(log for _, log, _, _ in recorded)
    published = [publish for _, _, publish, _ in states]
    assert published == sorted(published)
    assert min(published) > 1_700_000_000_000_000_000


@pytest.mark.usefixtures("brief_repair")
def test_messages_without_a_stamp_get_the_newest_simulated_time_and_never_0(stage: Stage) -> None:
    stage.send(topics.SCENARIO, String(data="name: x"))
    stage.all_there()
    stage.ros.spin_for(0.2)
    stage.send(topics.STATE, stage.write_state(9, STATE))
    stage.ros.spin_for(0.2)
    stage.send(topics.OUTCOME, String(data=json.dumps({"states": 10})))
    stage.ros.spin_until(lambda: stage.node.finished)
    times = {topic: log for topic, log, _, _ in stage.recorded()}
    epoch_ns = stage.node.scenario.stamp_ns(0)
    assert times["/skydiver/scenario"] == epoch_ns
    assert times["/skydiver/outcome"] == stage.node.scenario.stamp_ns(9)


def test_a_message_whose_stamp_was_not_set_is_kept_and_counted(stage: Stage) -> None:
    stage.all_there()
    stage.send(topics.STATE, topics.STATE.type())
    stage.ros.spin_for(0.2)
    (message,) = stage.recorded()
    assert message[1] == stage.node.scenario.stamp_ns(0)
    assert stage.node.refusals.counts == {"stamp": 1}


def test_its_diagnostics_have_the_newest_simulated_time(stage: Stage) -> None:
    heard = stage.others.hear(topics.DIAGNOSTICS)
    stage.all_there()
    stage.send(topics.STATE, stage.write_state(9, STATE))

    def steps() -> list[int]:
        own = [message for message in heard if message.status[0].name == "skydiver/recorder"]
        return [stage.grid.step_of(message.header.stamp) for message in own]

    stage.ros.spin_until(lambda: 9 in steps())
    assert set(steps()) <= {0, 9}


def test_a_launch_waits_for_it_longer_than_it_waits_for_lost_messages() -> None:
    folder = Path(__file__).resolve().parents[1] / "launch"
    for path in folder.glob("*.launch.xml"):
        values = {e.get("name"): e.get("value") for e in ElementTree.parse(path).getroot().iter("let")}
        assert float(values["sigterm_timeout"] or 0) > bag_recorder._REPAIR_S, path.name


def test_it_is_ready_only_when_it_hears_every_topic(stage: Stage) -> None:
    ready = stage.others.hear(topics.RECORDER_READY)
    for topic in RECORDED[:-1]:
        stage.others.sends(topic)
    stage.ros.spin_for(0.5)
    assert ready == []
    stage.others.sends(RECORDED[-1])
    stage.ros.spin_until(lambda: ready)
    late = stage.ros.partner("late").hear(topics.RECORDER_READY)
    stage.ros.spin_until(lambda: late)


def test_the_outcome_ends_the_recording(stage: Stage) -> None:
    stage.all_there()
    assert not stage.node.finished
    stage.send(topics.OUTCOME, String(data=json.dumps({"outcome": "completed", "states": 0})))
    stage.ros.spin_until(lambda: stage.node.finished)


def test_an_outcome_of_an_earlier_flight_neither_ends_it_nor_is_recorded(ros: Ros, tmp_path: Path) -> None:
    earlier = ros.partner("earlier")
    earlier.sends(topics.OUTCOME).publish(String(data=json.dumps({"outcome": "completed", "states": 0})))
    stage = Stage(ros, tmp_path / "bag").all_there()
    ros.spin_until(lambda: stage.node.refusals.counts["earlier"])
    ros.spin_for(0.3)
    assert not stage.node.finished
    assert stage.recorded() == []


@pytest.mark.parametrize(
    "text",
    [
        "hello",
        "",
        "{",
        "[]",
        '{"states": null}',
        '{"states": -1}',
        '{"states": true}',
        '{"outcome": "completed"}',
    ],
)
@pytest.mark.usefixtures("brief_repair")
def test_a_text_that_is_no_outcome_is_refused_and_the_recording_goes_on(stage: Stage, text: str) -> None:
    stage.all_there()
    stage.send(topics.STATE, stage.write_state(0, STATE))
    stage.send(topics.OUTCOME, String(data=text))
    stage.ros.spin_until(lambda: stage.node.refusals.counts == {"outcome": 1})
    stage.send(topics.STATE, stage.write_state(1, STATE))
    stage.ros.spin_for(0.3)
    assert not stage.node.finished
    stage.send(topics.OUTCOME, String(data='{"states": 2}'))
    stage.ros.spin_until(lambda: stage.node.finished)
    assert [topic for topic, *_ in stage.recorded()].count("/skydiver/state") == 2


def test_bytes_that_are_no_message_on_outcome_are_refused_and_the_recording_goes_on(stage: Stage) -> None:
    """The recorder takes bytes, which the middleware has not looked into."""
    stage.all_there()
    stage.send(topics.STATE, stage.write_state(0, STATE))
    stage.others.sends(topics.OUTCOME).publish(bytes([0, 1, 0, 0, 255, 255, 255, 127, 1]))
    stage.ros.spin_until(lambda: stage.node.refusals.counts == {"outcome": 1})
    assert not stage.node.finished
    stage.send(topics.OUTCOME, String(data='{"states": 1}'))
    stage.ros.spin_until(lambda: stage.node.finished)


@pytest.mark.parametrize("states", [0, 90])
def test_an_outcome_of_another_number_of_states_is_refused_when_the_flight_goes_on(
    stage: Stage, states: int
) -> None:
    stage.all_there()
    for k in range(20):
        stage.send(topics.STATE, stage.write_state(k, STATE))
    stage.ros.spin_for(0.2)
    stage.send(topics.OUTCOME, String(data=json.dumps({"states": states})))
    stage.ros.spin_for(0.2)
    assert not stage.node.finished
    stage.send(topics.STATE, stage.write_state(20, STATE))
    stage.ros.spin_until(lambda: stage.node.refusals.counts == {"outcome": 1})
    assert not stage.node.finished


@pytest.mark.usefixtures("brief_repair")
def test_an_outcome_of_another_number_of_states_counts_when_nothing_comes_any_more(
    ros: Ros, tmp_path: Path
) -> None:
    """The last states may have been lost."""
    stage = Stage(ros, tmp_path / "bag").all_there()
    stage.send(topics.STATE, stage.write_state(0, STATE))
    stage.send(topics.OUTCOME, String(data=json.dumps({"states": 9})))
    ros.spin_until(lambda: stage.node.finished)
    assert "only 1 of 9 messages of state were recorded" in stage.node.missing()


@pytest.mark.parametrize("seconds", [1, 60, 1_800_000_000])
def test_a_stamp_outside_of_the_flight_does_not_move_its_time(stage: Stage, seconds: int) -> None:
    """Before the epoch (the scenario's is 1 735 689 600 s or so), after the end, and by the wall clock."""
    strange_s = stage.grid.epoch_ns // 10**9 + 60 if seconds == 60 else seconds
    stage.all_there()
    stage.send(topics.STATE, stage.write_state(3, STATE))
    stage.ros.spin_for(0.2)
    for topic in (topics.DIAGNOSTICS, topics.COMMAND):
        message = topic.type()
        message.header.stamp.sec = strange_s
        stage.send(topic, message)
    stage.ros.spin_until(lambda: stage.node.refusals.counts == {"stamp": 2})
    stage.send(topics.CHANGES, String(data="later"))
    stage.ros.spin_for(0.2)
    stage.node.close()
    times = {topic: log for topic, log, _, _ in messages_of(stage.folder)}
    here_ns = stage.node.scenario.stamp_ns(3)
    assert [times[name] for name in ("/diagnostics", "/skydiver/command", "/skydiver/changes")] == [
        here_ns
    ] * 3


def test_only_the_plant_moves_the_time_of_messages_without_a_stamp(stage: Stage) -> None:
    stage.all_there()
    stage.send(topics.STATE, stage.write_state(3, STATE))
    stage.send(topics.COMMAND, NamedValuesWriter(stage.grid, CONTROL_NAMES).fill(9, np.zeros(4)))
    stage.ros.spin_for(0.2)
    stage.send(topics.CHANGES, String(data="{}"))
    stage.ros.spin_for(0.2)
    times = {topic: log for topic, log, _, _ in stage.recorded()}
    assert times["/skydiver/changes"] == stage.node.scenario.stamp_ns(3)


def test_it_stays_until_the_whole_flight_is_there(stage: Stage) -> None:
    """Here the state of step 1 comes last, as it does when it had to be sent again."""
    stage.all_there()
    for k in (0, 2):
        stage.send(topics.STATE, stage.write_state(k, STATE))
    stage.send(topics.OUTCOME, String(data=json.dumps({"states": 3})))
    stage.ros.spin_until(lambda: stage.node.finished)
    assert "only 2 of 3 messages of state were recorded" in stage.node.missing()
    stage.send(topics.STATE, stage.write_state(1, STATE))
    stage.ros.spin_until(lambda: "state were" not in " ".join(stage.node.missing()))


def test_the_folder_holds_a_bag_with_its_scenario_and_versions(stage: Stage) -> None:
    stage.all_there()
    stage.send(topics.STATE, stage.write_state(0, STATE))
    stage.ros.spin_for(0.2)
    stage.recorded()
    assert {path.name for path in stage.folder.iterdir()} == {
        "bag_0.mcap",
        "metadata.yaml",
        "scenario.yaml",
        "versions.json",
    }
    assert load_scenario(str(stage.folder / "scenario.yaml")) == stage.node.scenario
    versions = json.loads((stage.folder / "versions.json").read_text())
    assert versions["rmw"] == "rmw_fastrtps_cpp"
    assert versions["numpy"] == np.__version__
    metadata = yaml.safe_load((stage.folder / "metadata.yaml").read_text())
    listed = metadata["rosbag2_bagfile_information"]["topics_with_message_count"]
    profiles = {t["topic_metadata"]["name"]: t["topic_metadata"]["offered_qos_profiles"][0] for t in listed}
    assert len(profiles) == len(RECORDED)
    assert profiles["/skydiver/outcome"]["durability"] == "transient_local"
    assert profiles["/skydiver/state"]["durability"] == "volatile"


def test_the_schemas_decode_the_messages(stage: Stage) -> None:
    from mcap_ros2.decoder import DecoderFactory

    stage.all_there()
    data = stage.send(topics.STATE, stage.write_state(3, STATE))
    stage.ros.spin_for(0.2)
    stage.recorded()
    (path,) = stage.folder.glob("*.mcap")
    with path.open("rb") as stream:
        ((_, _, _, message),) = make_reader(
            stream, decoder_factories=[DecoderFactory()]
        ).iter_decoded_messages()
    assert message.pose.pose.position.z == 4000.0
    assert deserialize_message(data, topics.STATE.type).pose.pose.position.z == 4000.0


def test_without_a_name_the_folder_is_named_by_time_and_scenario(
    ros: Ros, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    node = ros.add(RecorderNode(ros.context, overrides()))
    node.close()
    (folder,) = (tmp_path / "bags").iterdir()
    assert folder.name[8] == "T"
    assert folder.name.endswith("Z_fast_turn_unknown_dynamics")


def test_a_folder_that_exists_is_refused(ros: Ros, tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="exists already"):
        RecorderNode(ros.context, overrides(bag_folder=str(tmp_path)))


def test_a_folder_that_exists_ends_the_process_with_one_sentence(
    processes: Processes, tmp_path: Path
) -> None:
    recorder = processes.start("recorder", overrides(bag_folder=str(tmp_path)))
    assert recorder.wait() == 2
    last = recorder.output.strip().splitlines()[-1]
    assert last.startswith("recorder_node: ")
    assert "exists already" in last
    assert "Traceback" not in recorder.output
