# SPDX-License-Identifier: Apache-2.0
"""A recorder node under test, and a partner in the place of all other nodes."""

from pathlib import Path
from typing import Any

from rclpy.serialization import serialize_message
from ros_fixtures import Partner, Ros, overrides
from std_msgs.msg import String

from bags import Row, stored
from skydiver_utc.messages import outcome_text, scenario_text
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.topics import RECORDED, Topic

NEEDED = tuple(topic for topic in RECORDED if topic.needed)


class Stage:
    """A recorder node, and a partner in the place of all others."""

    def __init__(self, ros: Ros, folder: Path, **parameters: object) -> None:
        self.ros, self.folder = ros, folder
        self.node = ros.node("recorder", overrides(out=str(folder), **parameters))
        self.others: Partner = ros.partner("others")
        self.ready = self.others.receive(topics.RECORDER_READY)
        self.sent: list[tuple[str, bytes]] = []

    def all_there(self) -> "Stage":
        """Publish the needed topics until the recorder is ready, with a scenario of the run "r"."""
        self.send(topics.SCENARIO, String(data=scenario_text("name: x", "r")))
        for topic in NEEDED:
            self.others.publisher(topic)
        self.ros.spin_until(lambda: self.ready)
        assert self.ready[0].data == str(self.folder)
        return self

    def send(self, topic: Topic, message: Any) -> bytes:
        """Send a message, or bytes; serializations of one message differ in their padding, hence the bytes."""
        data = message if isinstance(message, bytes) else bytes(serialize_message(message))
        publisher = self.others.publisher(topic)
        self.ros.spin_until(publisher.get_subscription_count)
        publisher.publish(data)
        self.sent.append((publisher.topic_name, data))
        return data

    def stamped(self, topic: Topic, k: int) -> Any:
        """A message of this topic with the stamp of step k."""
        message = topic.type()
        self.node.grid.set_stamp(message.clock if topic is topics.CLOCK else message.header.stamp, k)
        return message

    def state(self, k: int) -> bytes:
        """Send the state of step k, wait until it has been received."""
        data = self.send(topics.STATE, self.stamped(topics.STATE, k))
        self.ros.spin_until(lambda: self.node.newest_step() >= k)
        return data

    def outcome(self, states: int, run_id: str = "r", outcome: str = "completed") -> None:
        """Send an outcome."""
        text = outcome_text(run_id, outcome, "", wall_time_s=1.0, states=states)
        self.send(topics.OUTCOME, String(data=text))

    def recorded(self) -> list[Row]:
        """Close the recorder; the messages of others."""
        self.node.close()
        own = {topic.name for topic in (topics.DIAGNOSTICS, topics.LOGS, topics.PARAMETER_EVENTS)}
        return [message for message in stored(self.folder) if message.topic not in own]
