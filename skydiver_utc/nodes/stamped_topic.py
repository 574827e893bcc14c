# SPDX-License-Identifier: Apache-2.0
"""Publishers of numbers at a step: states, controls, measurements, telemetry."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from skydiver_utc.arrays import Array
from skydiver_utc.estimators.sensor_models import SensorOfPlant
from skydiver_utc.messages import fill_fields, fill_named, fill_state
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.node import ScenarioNode
from skydiver_utc.nodes.topics import Topic
from skydiver_utc.plants.protocol import Plant


class StampedTopic:
    """A publisher of numbers, and its message, with a stamp where the type has one; names: those of a JointState."""

    def __init__(
        self,
        node: ScenarioNode,
        topic: Topic,
        names: Sequence[str],
        frame: str = "",
        fill: Callable[[Any, Array], Any] = fill_named,
    ) -> None:
        self.publisher, self.message = node.advertise(topic), topic.type()
        self._node, self._fill = node, fill
        if hasattr(self.message, "header"):
            self.message.header.frame_id = frame
        if hasattr(self.message, "name"):
            self.message.name = list(names)
        if hasattr(self.message, "child_frame_id"):
            self.message.child_frame_id = "body"

    def publish(self, k: int, values: Array) -> None:
        """Publish values (n,) of step k."""
        self._node.grid.set_stamp(self.message.header.stamp, k)
        self.publisher.publish(self._fill(self.message, values))

    def answer(self, stamp: Any, values: Array) -> None:
        """Publish values (n,) with the stamp of the message that they answer."""
        self._fill(self.message, values)
        self.repeat(stamp)

    def repeat(self, stamp: Any) -> None:
        """Publish the last values again."""
        if hasattr(self.message, "header"):
            self.message.header.stamp = stamp
        self.publisher.publish(self.message)


def state_topic(node: ScenarioNode, topic: Topic, plant: Plant) -> StampedTopic:
    """A topic with states of a plant, in the message that the plant has for them."""
    frame = "world" if plant.state_message == "odometry" else ""
    return StampedTopic(node, topic.of_plant(plant), plant.state_names, frame, fill_state)


def sensor_topic(node: ScenarioNode, sensor: SensorOfPlant) -> StampedTopic:
    """A topic with the measurements of a sensor, in the message that it has for them."""
    topic = topics.sensor_topic(sensor.name, sensor.message)
    frame = "world" if sensor.message == "TwistStamped" else "body"
    return StampedTopic(node, topic, sensor.names, frame, partial(fill_fields, fields=sensor.fields))
