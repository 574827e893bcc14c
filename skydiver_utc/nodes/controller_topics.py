# SPDX-License-Identifier: Apache-2.0
"""The messages that a controller publishes in answer to a state."""

from dataclasses import replace
from typing import Any

import numpy as np
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.protocol import Decision
from skydiver_utc.messages import TWIST_COMPONENTS, fill_fields, fill_named
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.node import ScenarioNode
from skydiver_utc.parameters import ParameterError


class ControllerTopics:
    """The publishers of a controller, and their messages."""

    def __init__(self, node: ScenarioNode, control_names: tuple[str, ...]) -> None:
        self._settings = s = node.settings
        unknown = set(s.command_components) - set(TWIST_COMPONENTS)
        if s.command_message == "twist" and (len(s.command_components) != len(control_names) or unknown):
            raise ParameterError(
                f"command_components must name a component of the twist for each of {', '.join(control_names)}:"
                f" {len(control_names)} of {', '.join(TWIST_COMPONENTS)}"
            )
        command_type = topics.COMMAND_TYPES[s.command_message]
        command = topics.COMMAND.of_type(command_type)
        if node.scenario.has_estimator:
            command = replace(command, subscribers=(topics.PLANT, topics.ESTIMATOR))
        self._command = node.advertise(command)
        self._telemetry = node.advertise(topics.TELEMETRY)
        self._clock = node.publisher(topics.CLOCK) if s.publish_clock else None
        self._command_message = command_type()
        if s.command_message == "joint_state":
            self._command_message.name = list(control_names)
        self._telemetry_message = JointState()

    def publish_command(self, stamp: Any, command: Array) -> None:
        """The control (m,), in the message that the plant takes."""
        message = self._command_message
        match self._settings.command_message:
            case "joint_state":
                message.header.stamp = stamp
                fill_named(message, command)
            case "float64_multi_array":
                message.data = command.tolist()
            case _:
                fill_fields(message, command, self._settings.command_components)
        self._command.publish(message)

    def name_telemetry(self, names: tuple[str, ...]) -> None:
        """Names of the controller's telemetry."""
        self._telemetry_message.name = [*names, "solve_time", "status"]

    def publish_telemetry(self, stamp: Any, decision: Decision, solve_time_s: float) -> None:
        """The values behind a decision; and the clock where it is asked for."""
        self._telemetry_message.header.stamp = stamp
        values = np.append(decision.telemetry, (solve_time_s, float(decision.status)))
        self._telemetry.publish(fill_named(self._telemetry_message, values))
        if self._clock is not None:
            self._clock.publish(Clock(clock=stamp))
