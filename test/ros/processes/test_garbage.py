# SPDX-License-Identifier: Apache-2.0
"""Random bytes on every topic of a recorded run: no node crashes, and the run goes on."""

import random
import shutil
import signal
from pathlib import Path

import own_slots
import pytest
from own_slots import CART, cart_file
from ros_fixtures import JOINT_STATE, Processes, Ros

from skydiver_utc.nodes import topics
from skydiver_utc.recording.recovery import survey

pytest_plugins = ("ros_fixtures",)
pytestmark = pytest.mark.processes

COUNT = 100  # on each topic
LONGEST = 200
# Longer bytes cannot be published: the type has a fixed length.
LONGEST_CLOCK = 8


def _of_cart(topic: topics.Topic) -> topics.Topic:
    return topic.of_type(JOINT_STATE.type) if topic in (topics.STATE, topics.ESTIMATE) else topic


def test_random_bytes_on_every_topic_stop_no_node(ros: Ros, processes: Processes, tmp_path: Path) -> None:
    shutil.copy(own_slots.__file__, tmp_path)
    text = CART + 'estimator: {kind: "own_slots:Averaged"}'
    given = {"scenario": cart_file(tmp_path, text), "duration_s": 600.0}
    waiting = given | {"wait_for_recorder": True}
    nodes = [
        processes.start("recorder", given | {"out": tmp_path / "run"}),
        processes.start("controller", waiting),
        processes.start("reference", waiting),
        processes.start("estimator", waiting),
        processes.start("plant", waiting | {"command_timeout_s": 0.5, "command_retries": 1000}),
    ]
    partner = ros.partner("garbage")
    states = partner.receive(JOINT_STATE)
    ros.spin_until(lambda: len(states) > 100)
    draw = random.Random(4)
    for topic in (_of_cart(topic) for topic in topics.TOPICS):
        publisher = partner.publisher(topic)
        longest = LONGEST_CLOCK if topic is topics.CLOCK else LONGEST
        for _ in range(COUNT):
            publisher.publish(bytes([0, 1, 0, 0]) + draw.randbytes(draw.randrange(longest)))
            ros.executor.spin_once(timeout_sec=0.001)
    before = len(states)
    ros.spin_until(lambda: len(states) > before + 100)
    assert not any(node.ended for node in nodes)
    nodes[4].signal(signal.SIGINT)
    assert nodes[4].wait() == 0, nodes[4].output
    assert nodes[0].wait() == 0, nodes[0].output
    for node in nodes[1:4]:
        node.signal(signal.SIGINT)
        assert node.wait() == 0, node.output
    for node in nodes:
        assert "Traceback" not in node.output
    found = survey(tmp_path / "run")
    assert found.whole
    assert found.counts["/skydiver/state"] > before
