# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc replay`` with a real player."""

from pathlib import Path

import pytest
from child_processes import PATIENCE_S
from command_line import start
from rclpy.qos import QoSDurabilityPolicy, QoSProfile
from ros_fixtures import Ros
from std_msgs.msg import String

from bags import START_NS, Row, text_message
from skydiver_utc.recording.metadata import offered_qos
from skydiver_utc.recording.schemas import message_schema
from skydiver_utc.recording.writer import BagWriter

pytest_plugins = ("ros_fixtures",)
pytestmark = pytest.mark.processes
# A subscriber matches the player some time after the player has matched it: with this none is too late.
EVERY = QoSProfile(depth=100, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)


def bag(folder: Path) -> Path:
    rows = [Row("/text", START_NS + k * 10**7, 1, text_message(str(k))) for k in range(30)]
    with BagWriter(folder) as writer:
        latched = offered_qos(EVERY.depth, "RELIABLE", "TRANSIENT_LOCAL")
        text = writer.add_topic("/text", *message_schema("std_msgs/msg/String"), latched)
        clock = writer.add_topic("/clock", *message_schema("rosgraph_msgs/msg/Clock"), "")
        for row in rows:
            writer.write(text, row.cdr, row.log_time, row.publish_time)
        writer.write(clock, b"\0\1\0\0" + b"\xff" * 100, START_NS, 1)
    return folder


@pytest.fixture
def texts(ros: Ros) -> list[str]:
    """The texts that are played, from now on."""
    received: list[str] = []
    ros.partner().create_subscription(String, "/text", lambda message: received.append(message.data), EVERY)
    return received


def test_a_recording_is_played_and_rejected_messages_are_counted(
    ros: Ros, domain: int, tmp_path: Path, texts: list[str]
) -> None:
    process = start("replay", bag(tmp_path / "bag"), "--rate", "2", ROS_DOMAIN_ID=domain)
    # Of what the player has sent, some is received after its end.
    ros.spin_until(lambda: process.poll() is not None and (process.returncode != 0 or len(texts) >= 30))
    _, stderr = process.communicate()
    assert process.returncode == 0, stderr
    assert texts == [str(k) for k in range(30)]
    assert any("1 messages of /clock" in line for line in stderr.splitlines())


def test_a_loop_is_ended_by_ctrl_c(ros: Ros, domain: int, tmp_path: Path, texts: list[str]) -> None:
    process = start(
        "replay", bag(tmp_path / "bag"), "--loop", "--rate", "5", "--topics", "/text", ROS_DOMAIN_ID=domain
    )
    ros.spin_until(lambda: texts.count("0") > 1)
    process.terminate()
    _, stderr = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130
    assert "Traceback" not in stderr
