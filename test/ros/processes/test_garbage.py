# SPDX-License-Identifier: Apache-2.0
"""Random bytes on every topic of a recorded run: no node crashes, and the run goes on."""

import random
import shutil
import signal
from pathlib import Path

import own_slots
import pytest
from own_slots import cart_file
from ros_fixtures import JOINT_STATE, Processes, Ros

from skydiver_utc.nodes import topics
from skydiver_utc.recording.recovery import survey

pytest_plugins = ("ros_fixtures",)
pytestmark = pytest.mark.processes

COUNT = 100  # on each topic
LONGEST = 200
# Longer bytes cannot be published: the type has a fixed length.
LONGEST_CLOCK = 8


def test_random_bytes_on_every_topic_stop_no_node(ros: Ros, processes: Processes, tmp_path: Path) -> None:
    shutil.copy(own_slots.__file__, tmp_path)
    given = {"scenario": cart_file(tmp_path), "duration_s": 600.0}
    waiting = given | {"wait_for_recorder": True}
    nodes = [
        processes.start("recorder", given | {"out": tmp_path / "run"}),
        processes.start("controller", waiting),
        processes.start("reference", waiting),
        processes.start("plant", waiting | {"command_timeout_s": 0.5, "command_retries": 1000}),
    ]
    partner = ros.partner("garbage")
    state = JOINT_STATE
    states = partner.receive(state)
    ros.spin_until(lambda: len(states) > 100)
    draw = random.Random(4)
    for topic in (state if topic is topics.STATE else topic for topic in topics.TOPICS):
        publisher = partner.publisher(topic)
        longest = LONGEST_CLOCK if topic is topics.CLOCK else LONGEST
        for _ in range(COUNT):
            publisher.publish(bytes([0, 1, 0, 0]) + draw.randbytes(draw.randrange(longest)))
            ros.executor.spin_once(timeout_sec=0.001)
    before = len(states)
    ros.spin_until(lambda: len(states) > before + 100)
    assert not any(node.ended for node in nodes)
    nodes[3].signal(signal.SIGINT)
    assert nodes[3].wait() == 0, nodes[3].output
    assert nodes[0].wait() == 0, nodes[0].output
    for node in nodes[1:3]:
        node.signal(signal.SIGINT)
        assert node.wait() == 0, node.output
    for node in nodes:
        assert "Traceback" not in node.output
    found = survey(tmp_path / "run")
    assert found.whole
    assert found.counts["/skydiver/state"] > before
