# SPDX-License-Identifier: Apache-2.0
"""The player node: a recording published again, byte for byte and in order, at any rate."""

from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from own_slots import cart_file
from recorded import fly
from ros_domains import reserved_domain
from ros_fixtures import JOINT_STATE, Ros

from bags import Row, text_message, write_bag
from skydiver_utc.errors import RecordingError
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.lifecycle import RefusedError
from skydiver_utc.nodes.player_node import PlayerNode
from skydiver_utc.nodes.topics import RECORDED, Topic
from skydiver_utc.parameters import ParameterError
from skydiver_utc.recording.reader import read_bag
from skydiver_utc.recording.schemas import message_schema

pytest_plugins = ("ros_fixtures",)

OF_NODES = (topics.LOGS, topics.PARAMETER_EVENTS)
OF_CART = tuple(JOINT_STATE if each is topics.STATE else each for each in RECORDED if each not in OF_NODES)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recorded run of the cart; its nodes are gone."""
    folder = tmp_path_factory.mktemp("recorded")
    with reserved_domain() as domain, closing(Ros(domain)) as ros:
        return fly(ros, folder / "run", {"scenario": cart_file(folder)}).folder


def audience(ros: Ros, subscribed: tuple[Topic, ...] = OF_CART) -> dict[str, list[bytes]]:
    """Lists, by topic, of the bytes that come from now on."""
    partner = ros.partner("audience")
    return {partner.resolve_topic_name(topic.name): partner.receive(topic, raw=True) for topic in subscribed}


def count(received: Mapping[str, Sequence[bytes]]) -> int:
    return sum(map(len, received.values()))


def player(ros: Ros, run: Path, **parameters: object) -> PlayerNode:
    node: PlayerNode = ros.add(PlayerNode(ros.context, {"run": str(run), **parameters}))
    return node


@pytest.mark.parametrize(
    ("start_s", "parameters"),
    [(0.0, {"rate": 0.7}), (0.0, {"rate": 1000.0}), (0.2, {"topics": ["state", "/skydiver/command"]})],
)
def test_the_messages_chosen_come_again_in_the_order_of_their_time_byte_for_byte(
    ros: Ros, run: Path, start_s: float, parameters: dict[str, Any]
) -> None:
    received = audience(ros)
    node = player(ros, run, start_s=start_s, **parameters)
    bag = {name: topic for name, topic in read_bag(run).items() if len(topic)}
    begin_ns = min(topic.log_times_ns.min() for topic in bag.values()) + round(start_s * 1e9)
    chosen = bag.keys() - {topic.name for topic in OF_NODES}
    if "topics" in parameters:
        chosen = {"/clock", "/skydiver/state", "/skydiver/command"}
    expected = {
        name: [
            bag[name].cdr[i]
            for i in np.argsort(bag[name].log_times_ns, kind="stable")
            if bag[name].log_times_ns[i] >= begin_ns
        ]
        for name in chosen
    }
    ros.spin_until(lambda: node.finished and count(received) >= count(expected))
    assert {name: messages for name, messages in received.items() if messages} == expected
    assert node.close() == 0


def test_the_order_within_a_step_is_that_of_the_table(ros: Ros, run: Path) -> None:
    node = player(ros, run)
    stamps = [item.log_time_ns for item in node.items]
    assert stamps == sorted(stamps)
    of_step = [item.topic for item in node.items if item.log_time_ns == stamps[len(stamps) // 2]]
    places = [of_step.index(f"/skydiver/{name}") for name in ("state", "command", "applied_command")]
    assert [of_step.index("/clock"), *places] == sorted([of_step.index("/clock"), *places])


def test_latched_messages_are_latched_again(ros: Ros, run: Path) -> None:
    node = player(ros, run, rate=1000.0, start_s=0.3)
    ros.spin_until(lambda: node.finished)
    late = audience(ros, (topics.SCENARIO, topics.OUTCOME, topics.REFERENCE_PREVIEW, JOINT_STATE))
    recorded = read_bag(run)
    latched = ("/skydiver/scenario", "/skydiver/outcome", "/skydiver/reference")
    ros.spin_until(lambda: count(late) >= sum(len(recorded[name]) for name in latched))
    for name in latched:
        assert late[name] == recorded[name].cdr
    assert late["/skydiver/state"] == []


INSTALLED = message_schema("std_msgs/msg/String")


def text_bag(folder: Path, schema: tuple[str, str, str] = INSTALLED) -> Path:
    rows = [Row("/text", 10**18 + k * 10**7, 1, text_message(str(k))) for k in range(3)]
    return write_bag(folder, rows, schema=schema)


def test_a_recording_without_a_clock_gets_one(ros: Ros, tmp_path: Path) -> None:
    clocks = ros.partner().receive(topics.CLOCK)
    node = player(ros, text_bag(tmp_path / "bag"))
    ros.spin_until(lambda: node.finished and len(clocks) == 3)
    assert [clock.clock.nanosec for clock in clocks] == [0, 10_000_000, 20_000_000]


@pytest.mark.parametrize(
    ("schema", "parameters", "word"),
    [
        (INSTALLED, {"topics": ["/other"]}, "/other"),
        (INSTALLED, {"rate": float("nan")}, "rate"),
        (INSTALLED, {"rate": 0.0}, "rate"),
        (INSTALLED, {"rat": 5.0}, "rat"),
        (("own_msgs/msg/Text", "string data\n", ""), {}, "own_msgs/msg/Text"),
        (("std_msgs/msg/String", "string data\n", "RIHS01_0"), {}, "std_msgs/msg/String"),
    ],
    ids=["no such topic", "no number", "no rate", "no such parameter", "not installed", "another definition"],
)
def test_what_cannot_be_played_is_named(
    ros: Ros, tmp_path: Path, schema: tuple[str, str, str], parameters: dict[str, object], word: str
) -> None:
    with pytest.raises((ParameterError, RecordingError), match=word):
        player(ros, text_bag(tmp_path / "bag", schema), **parameters)


def test_a_replay_beside_another_clock_is_refused(ros: Ros, tmp_path: Path) -> None:
    ros.partner("other").publisher(topics.CLOCK)
    with pytest.raises(RefusedError, match="/clock"):
        player(ros, text_bag(tmp_path / "bag"))
