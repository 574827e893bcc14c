# SPDX-License-Identifier: Apache-2.0
"""The messages that a plant publishes in each step."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from skydiver_utc.disturbances.composed import Composed
from skydiver_utc.estimators.protocol import Reading
from skydiver_utc.estimators.sensor_models import SensorOfPlant
from skydiver_utc.messages import fill_named, fill_sensor, fill_state
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.node import ScenarioNode
from skydiver_utc.plants.protocol import Plant

Vector = NDArray[np.float64]


class SensorTopic:
    """The publisher of a sensor, and its message."""

    def __init__(self, node: ScenarioNode, sensor: SensorOfPlant) -> None:
        self._grid, self._fields = node.grid, sensor.fields
        topic = topics.sensor_topic(sensor.name, sensor.message)
        self.publisher, self._message = node.advertise(topic), topic.type()
        self._message.header.frame_id = "world" if sensor.message == "TwistStamped" else "body"
        if not self._fields:
            self._message.name = list(sensor.names)

    def publish(self, reading: Reading) -> None:
        """A measurement with its stamp."""
        self._grid.set_stamp(self._message.header.stamp, reading.step)
        self.publisher.publish(fill_sensor(self._message, self._fields, reading.values))


class PlantTopics:
    """The publishers of a plant, and their messages; `given`: the one for the estimator, or else the controller."""

    def __init__(
        self, node: ScenarioNode, plant: Plant, disturbance: Composed, sensors: Sequence[SensorOfPlant]
    ) -> None:
        self._grid, self._plant, self._disturbance = node.grid, plant, disturbance
        state_type = topics.STATE_TYPES[plant.state_message]
        # Before the clock: a reference that has discovered the clock waits for the scenario, too.
        self.scenario = node.advertise(topics.SCENARIO)
        state = topics.STATE.of_type(state_type)
        self.state = node.advertise(replace(state, subscribers=()) if sensors else state)
        self._clock = node.advertise(topics.CLOCK)
        self._applied = node.advertise(topics.APPLIED_COMMAND)
        self._acted = node.advertise(topics.DISTURBANCE) if disturbance.names else None
        self._acted_message = JointState(name=list(disturbance.names))
        self._pushed = node.advertise(topics.PUSHED)
        self._pushed_message = JointState(name=list(plant.state_names))
        self.outcome = node.advertise(topics.OUTCOME)
        self._sensors = [SensorTopic(node, sensor) for sensor in sensors]
        self.given = self._sensors[-1].publisher if sensors else self.state
        self._state_message = state_type()
        if plant.state_message == "odometry":
            self._state_message.header.frame_id, self._state_message.child_frame_id = "world", "body"
        else:
            self._state_message.name = list(plant.state_names)
        self._clock_message = Clock()
        self._applied_message = JointState(name=list(plant.control_names))

    def publish_state(self, k: int, state: Vector) -> None:
        """State first: the controller works while the clock is sent."""
        self._grid.set_stamp(self._state_message.header.stamp, k)
        self.state.publish(fill_state(self._state_message, state))
        self._grid.set_stamp(self._clock_message.clock, k)
        self._clock.publish(self._clock_message)
        if self._acted is not None:
            self._grid.set_stamp(self._acted_message.header.stamp, k)
            self._acted.publish(fill_named(self._acted_message, self._disturbance.acted(k, state)))

    def publish_pushed(self, k: int, change: Vector) -> None:
        """What users have added to the state (n,) of step k."""
        self._grid.set_stamp(self._pushed_message.header.stamp, k)
        self._pushed.publish(fill_named(self._pushed_message, change))

    def publish_readings(self, readings: Sequence[Reading]) -> None:
        """The measurements that arrive now, each with the stamp of its own step."""
        for reading in readings:
            self._sensors[reading.sensor].publish(reading)

    def publish_applied(self, k: int, applied: Vector) -> None:
        """The control of the actuators' state (a,) from step k on."""
        self._grid.set_stamp(self._applied_message.header.stamp, k)
        self._applied.publish(fill_named(self._applied_message, applied[: len(self._plant.control_names)]))
