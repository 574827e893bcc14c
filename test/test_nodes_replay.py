"""The player node: a recorded flight again, in order, byte for byte, at any rate; and its controller checked."""

import os
import pty
import subprocess
import sys
import termios
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from ros_fixtures import Partner, Ros, overrides
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from std_srvs.srv import SetBool

from skydiver_utc.cli import main
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.bag_player import PlayerNode
from skydiver_utc.nodes.bag_recorder import RecorderNode
from skydiver_utc.nodes.lockstep_controller import ControllerNode
from skydiver_utc.nodes.lockstep_plant import PlantNode
from skydiver_utc.nodes.preview_publisher import ReferenceNode
from skydiver_utc.nodes.topics import RECORDED, Topic, rosbag2_qos
from skydiver_utc.parameters import ParameterError
from skydiver_utc.recording.errors import RecordingError
from skydiver_utc.recording.playback import Item, in_order
from skydiver_utc.recording.reader import read_bag
from skydiver_utc.recording.schemas import message_schema
from skydiver_utc.recording.writer import BagWriter

pytest_plugins = ("ros_fixtures",)

DEPTH = 5000


def fly(ros: Ros, folder: Path, duration_s: float = 0.2, scenario: str = "slow_turn_pose_only") -> Path:
    """Record a flight on this executor; its nodes are gone afterwards."""
    given = overrides(duration_s, scenario=scenario, wait_for_recorder=True)
    recorder = ros.add(
        RecorderNode(ros.context, overrides(duration_s, scenario=scenario, bag_folder=str(folder)))
    )
    nodes = [ros.add(kind(ros.context, given)) for kind in (PlantNode, ReferenceNode, ControllerNode)]
    ros.spin_until(lambda: recorder.finished and not recorder.missing())
    for node in (*nodes, recorder):
        node.close()
        ros.remove(node)
    return folder


class Audience:
    """Hears topics as bytes, in the order in which they come within each topic."""

    def __init__(self, ros: Ros, heard: tuple[Topic, ...] = RECORDED) -> None:
        self.partner: Partner = ros.partner("audience")
        self.heard: dict[str, list[bytes]] = {}
        for topic in heard:
            self.listen(topic)

    def listen(self, topic: Topic) -> list[bytes]:
        name = topic.name if topic.name.startswith("/") else f"/skydiver/{topic.name}"
        messages = self.heard.setdefault(name, [])
        qos = QoSProfile(depth=DEPTH, reliability=topic.qos.reliability, durability=topic.qos.durability)
        self.partner.create_subscription(topic.type, name, messages.append, qos, raw=True)
        return messages

    @property
    def count(self) -> int:
        return sum(map(len, self.heard.values()))


def player(ros: Ros, run: Path, **parameters: object) -> PlayerNode:
    node: PlayerNode = ros.add(PlayerNode(ros.context, {"run": str(run), "discovery_s": 0.5, **parameters}))
    return node


@pytest.mark.parametrize("rate", [0.7, 5.0, 1000.0])
def test_every_message_comes_again_in_the_order_of_its_time_byte_for_byte(
    ros: Ros, tmp_path: Path, rate: float
) -> None:
    run = fly(ros, tmp_path / "run")
    audience = Audience(ros)
    node = player(ros, run, rate=rate)
    recorded = {
        name: [topic.cdr[i] for i in np.argsort(topic.log_times_ns, kind="stable")]
        for name, topic in read_bag(run).items()
        if len(topic)
    }
    ros.spin_until(lambda: node.finished)
    ros.spin_until(lambda: audience.count >= sum(map(len, recorded.values())))
    ros.spin_for(0.2)
    assert {name: heard for name, heard in audience.heard.items() if heard} == recorded
    assert node.close() == 0


def test_the_order_is_that_of_the_recording_over_all_topics(ros: Ros, tmp_path: Path) -> None:
    run = fly(ros, tmp_path / "run")
    with (run / "run_0.mcap").open("rb") as stream:
        from mcap.reader import make_reader

        stored = [
            Item(channel.topic, message.log_time, message.data)
            for _, channel, message in make_reader(stream).iter_messages(log_time_order=True)
        ]
    played = in_order(read_bag(run))
    assert sorted(played) == sorted(stored)
    assert [item.log_time_ns for item in played] == [item.log_time_ns for item in stored]
    for name in ("/clock", "/skydiver/state", "/skydiver/command", "/skydiver/applied_command"):
        of_step = [item.topic for item in played if item.log_time_ns == stored[100].log_time_ns]
        assert name in of_step
    assert of_step.index("/clock") < of_step.index("/skydiver/state") < of_step.index("/skydiver/command")


def test_what_was_latched_is_latched_again_for_late_listeners(ros: Ros, tmp_path: Path) -> None:
    run = fly(ros, tmp_path / "run")
    node = player(ros, run, rate=1000.0, start_s=0.1)
    ros.spin_until(lambda: node.finished)
    late = Audience(ros, (topics.SCENARIO, topics.OUTCOME, topics.REFERENCE_PREVIEW, topics.STATE))
    recorded = read_bag(run)
    ros.spin_until(lambda: late.count >= 2 + len(recorded["/skydiver/reference"]))
    ros.spin_for(0.2)
    assert late.heard["/skydiver/scenario"] == recorded["/skydiver/scenario"].cdr
    assert late.heard["/skydiver/outcome"] == recorded["/skydiver/outcome"].cdr
    assert late.heard["/skydiver/reference"] == recorded["/skydiver/reference"].cdr
    assert late.heard["/skydiver/state"] == []


def test_start_and_topics_choose_what_is_played(ros: Ros, tmp_path: Path) -> None:
    run = fly(ros, tmp_path / "run")
    audience = Audience(ros)
    node = player(ros, run, rate=1000.0, start_s=0.1, topics=["state", "/skydiver/command"])
    ros.spin_until(lambda: node.finished)
    recorded = read_bag(run)
    ros.spin_until(lambda: len(audience.heard["/skydiver/command"]) > 10)
    ros.spin_for(0.3)
    heard = {name: messages for name, messages in audience.heard.items() if messages}
    assert heard.keys() == {"/clock", "/skydiver/state", "/skydiver/command"}
    for name, messages in heard.items():
        times = recorded[name].log_times_ns
        assert messages == recorded[name].cdr[int(np.sum(times < times.min() + 100_000_000)) :], name


def test_the_service_pauses_and_goes_on(ros: Ros, tmp_path: Path) -> None:
    run = fly(ros, tmp_path / "run")
    audience = Audience(ros, (topics.STATE,))
    node = player(ros, run, rate=0.2, paused=True)
    client = audience.partner.create_client(SetBool, "/player/pause")

    def ask(pause: bool) -> Any:
        ros.spin_until(client.service_is_ready)
        answer = client.call_async(SetBool.Request(data=pause))
        ros.spin_until(answer.done)
        return answer.result()

    ros.spin_for(1.5)
    assert (audience.count, node.paused) == (0, True)
    assert ask(False).success
    ros.spin_until(lambda: audience.count > 5)
    assert ask(True).message.startswith("paused at 0.")
    ros.spin_for(0.3)
    before = audience.count
    ros.spin_for(0.5)
    assert audience.count == before < len(read_bag(run)["/skydiver/state"])
    ask(False)
    ros.spin_until(lambda: node.finished)
    ros.spin_until(lambda: audience.heard["/skydiver/state"] == read_bag(run)["/skydiver/state"].cdr)


def test_a_loop_begins_again(ros: Ros, tmp_path: Path) -> None:
    run = fly(ros, tmp_path / "run")
    audience = Audience(ros, (topics.STATE,))
    node = player(ros, run, rate=20.0, loop=True)
    states = read_bag(run)["/skydiver/state"].cdr
    ros.spin_until(lambda: audience.count > 2 * len(states))
    assert not node.finished
    assert audience.heard["/skydiver/state"][: 2 * len(states)] == states * 2


def text_bag(folder: Path, type_hash: str = "", type_name: str = "std_msgs/msg/String") -> Path:
    with BagWriter(folder) as bag:
        channel = bag.add_topic("/text", type_name, "string data\n", type_hash, "")
        for k in range(3):
            data = b"\x00\x01\x00\x00\x02\x00\x00\x00" + bytes([65 + k, 0])
            bag.write(channel, data, 10**18 + k * 10**7, 1)
    return folder


def test_a_recording_without_a_clock_gets_one(ros: Ros, tmp_path: Path) -> None:
    audience = Audience(ros, ())
    clocks: list[Clock] = []
    audience.partner.create_subscription(Clock, "/clock", clocks.append, 10)
    node = player(ros, text_bag(tmp_path / "bag"))
    ros.spin_until(lambda: node.finished and len(clocks) == 3)
    assert [clock.clock.nanosec for clock in clocks] == [0, 10_000_000, 20_000_000]


def spoilt(folder: Path) -> Path:
    """On every recorded topic a whole message between bytes that are none."""
    with BagWriter(folder) as bag:
        for number, topic in enumerate(RECORDED):
            name = topic.name if topic.name.startswith("/") else f"/skydiver/{topic.name}"
            offered = yaml.safe_dump([rosbag2_qos(topic.qos)])
            channel = bag.add_topic(name, *message_schema(topic.type_name), offered)
            whole = bytes(serialize_message(topic.type()))
            for k, data in enumerate((b"", whole, b"\x00\x01\x00\x00" + b"\xff" * 1000)):
                bag.write(channel, data, 10**18 + k * 10**8 + number, 1)
    return folder


def test_bytes_that_are_no_message_are_played_or_counted(ros: Ros, tmp_path: Path) -> None:
    """The middleware does not take more bytes than a type of fixed length can have."""
    run = spoilt(tmp_path / "run")
    audience = Audience(ros)
    node = player(ros, run)
    ros.spin_until(lambda: node.finished)
    recorded = {name: topic.cdr for name, topic in read_bag(run).items()}
    clocks = recorded.pop("/clock")
    ros.spin_until(lambda: audience.count >= 3 * len(recorded) + 2)
    ros.spin_for(0.2)
    assert audience.heard == recorded | {"/clock": clocks[:2]}
    assert node.not_sent == {"/clock": 1}
    assert node.close() == 0


def test_the_verb_tells_what_could_not_be_sent(domain: int, tmp_path: Path) -> None:
    ended = subprocess.run(
        [sys.executable, "-m", "skydiver_utc.cli", "replay", str(spoilt(tmp_path / "run"))],
        env={**os.environ, "ROS_DOMAIN_ID": str(domain)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert ended.returncode == 0, ended.stderr
    assert ended.stderr.splitlines()[-1].endswith("no messages of their topic's type: 1 on /clock")


@pytest.mark.parametrize(
    ("made", "parameters", "words"),
    [
        ({}, {"topics": ["/other"]}, "has no topic /other: choose some of /text"),
        ({}, {"rate": 0.0}, "rate of 0 cannot be played"),
        ({}, {"rate": float("nan")}, "rate of nan cannot be played"),
        ({}, {"start_s": 5.0}, "cannot begin at 5 s"),
        ({"type_name": "own_msgs/msg/Text"}, {}, "own_msgs/msg/Text, which is not installed"),
        ({"type_hash": "RIHS01_0"}, {}, "another definition of std_msgs/msg/String than the installed one"),
    ],
)
def test_what_cannot_be_played(
    ros: Ros, tmp_path: Path, made: dict[str, str], parameters: dict[str, object], words: str
) -> None:
    with pytest.raises((ParameterError, RecordingError), match=words):
        player(ros, text_bag(tmp_path / "bag", **made), **parameters)


@pytest.mark.parametrize("scenario", ["fast_turn_unknown_dynamics", "front_layout", "back_layout_open_loop"])
def test_the_controller_of_a_flight_over_ros_answers_as_recorded(
    ros: Ros, tmp_path: Path, scenario: str
) -> None:
    run = fly(ros, tmp_path / "run", scenario=scenario)
    result = CliRunner().invoke(main, ["replay", str(run), "--check"])
    assert result.exit_code == 0, result.output
    assert "all 48 commands are the recorded ones" in result.output


def test_options_of_the_check_need_it(tmp_path: Path) -> None:
    result = CliRunner().invoke(main, ["replay", str(tmp_path), "--json"])
    assert result.exit_code == 2
    assert "go with --check" in result.output


@pytest.mark.parametrize(
    "option", ["--rate=2", "--rate=1", "--start=1", "--loop", "--paused", "--topics=state", "--quiet"]
)
def test_the_check_refuses_options_of_playing(tmp_path: Path, option: str) -> None:
    result = CliRunner().invoke(main, ["replay", str(tmp_path), "--check", option])
    assert result.exit_code == 2
    assert "do not go with --check" in result.output


@pytest.mark.parametrize("names", ["", ",", "state,", "state, ,command"])
def test_a_topic_without_a_name_is_refused(tmp_path: Path, names: str) -> None:
    result = CliRunner().invoke(main, ["replay", str(tmp_path), "--topics", names])
    assert result.exit_code == 2
    assert f"--topics {names!r} has an empty name: write them as in state,command" in result.output


def test_a_folder_that_is_not_there_is_one_sentence(tmp_path: Path) -> None:
    result = CliRunner().invoke(main, ["replay", str(tmp_path / "nothere")])
    assert result.exit_code == 2
    (line,) = result.output.splitlines()
    assert line.startswith(f"Error: {tmp_path / 'nothere'} does not exist")


def test_an_option_that_does_not_fit_the_recording_is_one_sentence(domain: int, tmp_path: Path) -> None:
    run = text_bag(tmp_path / "bag")
    command = [sys.executable, "-m", "skydiver_utc.cli", "replay", str(run), "--start", "5"]
    ended = subprocess.run(
        command, env={**os.environ, "ROS_DOMAIN_ID": str(domain)}, capture_output=True, text=True, check=False
    )
    assert ended.returncode == 2
    (line,) = ended.stderr.splitlines()
    assert line.startswith("Error: the recording cannot be played: ")
    assert "player_node" not in line


def test_a_replay_into_a_flight_is_refused(ros: Ros, tmp_path: Path) -> None:
    run = text_bag(tmp_path / "bag")
    texts: list[Any] = []
    other = ros.partner("other")
    other.create_subscription(String, "/text", texts.append, 10)
    other.sends(topics.CLOCK)
    node = player(ros, run)
    ros.spin_until(lambda: node.finished)
    assert "/clock has another publisher" in node.refused
    ros.spin_for(0.2)
    assert texts == []


def test_the_verb_plays_and_the_space_bar_pauses(ros: Ros, domain: int, tmp_path: Path) -> None:
    """On a terminal: paused at first, then played to the end by one key; the terminal is as it was afterwards."""
    run = fly(ros, tmp_path / "run")
    audience = Audience(ros, (topics.STATE,))
    mine, its = pty.openpty()
    before = termios.tcgetattr(its)
    process = subprocess.Popen(
        [sys.executable, "-m", "skydiver_utc.cli", "replay", str(run), "--rate", "2", "--paused"],
        env={**os.environ, "ROS_DOMAIN_ID": str(domain), "TERM": "xterm"},
        stdin=its,
        stdout=its,
        stderr=its,
        start_new_session=True,
    )
    try:
        shown = b""
        os.set_blocking(mine, False)

        def read() -> bytes:
            nonlocal shown
            with suppress(BlockingIOError):
                shown += os.read(mine, 65536)
            return shown

        ros.spin_until(lambda: b"paused" in read())
        assert audience.count == 0
        os.write(mine, b" ")
        ros.spin_until(lambda: read() and process.poll() is not None)
        assert process.returncode == 0, shown.decode()
        assert termios.tcgetattr(its) == before
        ros.spin_until(lambda: audience.heard["/skydiver/state"] == read_bag(run)["/skydiver/state"].cdr)
    finally:
        process.kill()
        process.wait()
        os.close(mine)
        os.close(its)
