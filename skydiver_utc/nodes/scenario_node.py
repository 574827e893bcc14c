"""What all nodes share: parameters from the scenario, topics from the table, refusals counted."""

import sys
from collections.abc import Callable, Mapping
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription
from rclpy.timer import Timer

from skydiver_utc.nodes.border import Refusals
from skydiver_utc.nodes.node_parameters import resolve
from skydiver_utc.nodes.stamps import StepGrid
from skydiver_utc.nodes.topics import NAMESPACE, Topic
from skydiver_utc.parameters import Leaf, ParameterError

_LARGEST_INTEGER = 2**63 - 1


class ScenarioNode(Node):
    """A node that knows its scenario; `overrides` adds to the parameters given on the command line."""

    def __init__(
        self, kind: str, context: Context | None = None, overrides: Mapping[str, object] | None = None
    ) -> None:
        super().__init__(kind, namespace=NAMESPACE, context=context)
        try:
            resolved = resolve(kind, self._given_parameters() | dict(overrides or {}))
        except ParameterError:
            self.destroy_node()
            raise
        for leaf in resolved.parameters:
            value = list(leaf.value) if isinstance(leaf.value, tuple) else leaf.value
            self.declare_parameter(leaf.name, value, _descriptor(leaf), ignore_override=True)
        self.scenario = resolved.scenario
        self.own = resolved.own
        self.grid = StepGrid(resolved.scenario)
        self.refusals = Refusals(self.get_logger().warning)
        self.finished = False
        self._advertised: dict[Topic, Publisher] = {}
        self._steady_clock = Clock(clock_type=ClockType.STEADY_TIME)
        changes = "; ".join(resolved.changes) or "as in its file"
        self.get_logger().info(f"scenario {resolved.scenario.name}: {changes}")

    def close(self) -> int:
        """Say the last words and return the exit code; the node can still publish."""
        if self.refusals.counts:
            self.get_logger().warning(f"messages refused or ignored: {self.refusals.summary()}")
        return 0

    def advertise(self, topic: Topic) -> Publisher:
        """A publisher as the table of topics says."""
        self._advertised[topic] = self.create_publisher(topic.type, topic.name, topic.qos)
        return self._advertised[topic]

    def listen(self, topic: Topic, callback: Callable[[Any], None]) -> Subscription:
        """A subscription as the table of topics says."""
        return self.create_subscription(topic.type, topic.name, callback, topic.qos)

    def every(self, period_s: float, callback: Callable[[], None]) -> Timer:
        """A timer on the steady clock, whatever simulated time does."""
        return self.create_timer(period_s, callback, clock=self._steady_clock)

    def unmatched(self) -> list[str]:
        """Names of own topics that some listener of the table, or an awaited recorder, does not hear yet."""
        recorders = 1 if self.own.get("wait_for_recorder") else 0
        return [
            topic.name
            for topic, publisher in self._advertised.items()
            if publisher.get_subscription_count() < len(topic.listeners) + recorders * topic.recorded
        ]

    def _given_parameters(self) -> dict[str, object]:
        """Parameters from the command line and its files, also those that nobody declares."""
        with self.handle:
            given = self.handle.get_parameters(Parameter)
        return {name: parameter.value for name, parameter in given.items()}


def _descriptor(leaf: Leaf) -> ParameterDescriptor:
    """Unit, meaning and range of a parameter that cannot be set after the start."""
    text = leaf.description if leaf.unit in ("", "1") else f"{leaf.description} [{leaf.unit}]"
    descriptor = ParameterDescriptor(description=text, read_only=True)
    if leaf.choices:
        descriptor.additional_constraints = "one of " + ", ".join(leaf.choices)
    bounds = (leaf.minimum, leaf.maximum)
    if leaf.kind == "float" and bounds != (None, None):
        low, high = _closed(bounds, sys.float_info.max)
        descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
    elif leaf.kind == "int" and bounds != (None, None):
        low, high = _closed(bounds, _LARGEST_INTEGER)
        descriptor.integer_range = [IntegerRange(from_value=int(low), to_value=int(high), step=1)]
    return descriptor


def _closed(bounds: tuple[float | None, float | None], largest: float) -> tuple[float, float]:
    low, high = bounds
    return (-largest if low is None else low, largest if high is None else high)
