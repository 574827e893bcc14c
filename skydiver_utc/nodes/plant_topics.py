# SPDX-License-Identifier: Apache-2.0
"""The messages that a plant publishes in each step, and those with the same content of other nodes."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from rosgraph_msgs.msg import Clock

from skydiver_utc.arrays import Array
from skydiver_utc.disturbances.composed import Composed
from skydiver_utc.estimators.protocol import Reading
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


def _of_sensor(node: ScenarioNode, sensor: SensorOfPlant) -> StampedTopic:
    topic = topics.sensor_topic(sensor.name, sensor.message)
    frame = "world" if sensor.message == "TwistStamped" else "body"
    return StampedTopic(node, topic, sensor.names, frame, partial(fill_fields, fields=sensor.fields))


class PlantTopics:
    """The publishers of a plant; `given`: the one for the estimator, or else the controller.

    applied: the control from a step on; pushed: what users have added to the state of a step.
    """

    def __init__(
        self, node: ScenarioNode, plant: Plant, disturbance: Composed, sensors: Sequence[SensorOfPlant]
    ) -> None:
        self._grid, self._disturbance = node.grid, disturbance
        # Before the clock: a reference that has discovered the clock waits for the scenario, too.
        self.scenario = node.advertise(topics.SCENARIO)
        state = replace(topics.STATE, subscribers=()) if sensors else topics.STATE
        self._state = state_topic(node, state, plant)
        self.state = self._state.publisher
        self._clock, self._clock_message = node.advertise(topics.CLOCK), Clock()
        self.applied = StampedTopic(node, topics.APPLIED_COMMAND, plant.control_names)
        acting = disturbance.names
        self._acted = StampedTopic(node, topics.DISTURBANCE, acting) if acting else None
        self.pushed = StampedTopic(node, topics.PUSHED, plant.state_names)
        self.outcome = node.advertise(topics.OUTCOME)
        self._sensors = [_of_sensor(node, sensor) for sensor in sensors]
        self.given = self._sensors[-1].publisher if sensors else self.state

    def publish_state(self, k: int, state: Array) -> None:
        """State first: the controller works while the clock is sent."""
        self._state.publish(k, state)
        self._grid.set_stamp(self._clock_message.clock, k)
        self._clock.publish(self._clock_message)
        if self._acted is not None:
            self._acted.publish(k, self._disturbance.acted(k, state))

    def publish_readings(self, readings: Sequence[Reading]) -> None:
        """The measurements that arrive now, each with the stamp of its own step."""
        for reading in readings:
            self._sensors[reading.sensor].publish(reading.step, reading.values)
