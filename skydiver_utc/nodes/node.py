# SPDX-License-Identifier: Apache-2.0
"""The base of all nodes: settings and scenario, topics from the table, refused messages counted, diagnostics."""

import time
import uuid
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from typing import Any, ClassVar

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from skydiver_utc.messages import MessageError, Refusals, StepGrid
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.diagnostics import Health, Level, Rate, memory_mb
from skydiver_utc.nodes.lifecycle import ACTIVE, UNCONFIGURED, ManagedNode, destroyed_on_error
from skydiver_utc.nodes.topics import NAMESPACE, Topic
from skydiver_utc.parameters.nodes import resolve, scalars

_DIAGNOSTICS_PERIOD_S = 1.0
_PATIENCE_S = 5.0
_NEW_S = 10.0  # how long a node looks for another one of its name; discovery takes up to 3 s


class ScenarioNode(ManagedNode):
    """A node of a scenario; `overrides` adds to the parameters given on the command line.

    A subclass makes what it needs in `build`. `done`: its work is done. `refused`: a sentence on another node of its
    kind. `finished`: its process ends, because it is done with `autostart`, shut down or refused. `look_s`: how long
    a plant looks for another plant before it begins; `main` sets it.
    """

    KIND: ClassVar[str]
    MAIN: ClassVar[Any] = None  # the topic of which a namespace has one publisher; None: any number
    LIVE: ClassVar[tuple[str, ...]] = ()  # how names of parameters begin that can be set while the node runs

    def __init__(
        self,
        context: Context | None = None,
        overrides: Mapping[str, object] | None = None,
        look_s: float = 0.0,
    ) -> None:
        super().__init__(self.KIND, NAMESPACE, context)
        with destroyed_on_error(self):
            resolved = resolve(self.KIND, given_parameters(self) | dict(overrides or {}))
            self.settings: Any = resolved.settings
            self.scenario = resolved.scenario
            self.grid = StepGrid(self.scenario.stamp_ns(0), self.scenario.dt_ns)
            self.refusals = Refusals(self.get_logger().warning)
            self.done = False
            self.refused = ""
            self.look_s = look_s
            self._id, self._started_at = uuid.uuid4().hex, time.monotonic()
            self._advertised: dict[Topic, Publisher] = {}
            self._cpu_percent = Rate(100.0 * time.process_time())
            self._diagnostics = self.publisher(topics.DIAGNOSTICS)
            if self.MAIN is not None:
                self.subscribe(topics.DIAGNOSTICS, self._on_diagnostics)
            self.every(_DIAGNOSTICS_PERIOD_S, self.publish_diagnostics)
            self.every(_PATIENCE_S, self._log_what_is_missing)
            for name, value in scalars(resolved.settings, self.scenario).items():
                if value == []:  # rclpy has no type for it
                    continue
                fixed = ParameterDescriptor(read_only=not name.startswith(self.LIVE))
                self.declare_parameter(name, value, fixed, ignore_override=True)
            changes = ", ".join(f"{name} = {value}" for name, value in resolved.changes.items())
            self.get_logger().info(f"scenario {self.scenario.name}" + (f" with {changes}" if changes else ""))
            self.build()
            if self.settings.autostart:
                self.start()

    def build(self) -> None:
        """The end of the constructor: the parts, publishers and subscriptions of this node."""

    def set_parameters_atomically(self, parameter_list: list[Any]) -> SetParametersResult:
        """Set all or none; called by rclpy for each request, whose own sentence names no unknown parameter."""
        unknown = [each.name for each in parameter_list if not self.has_parameter(each.name)]
        if unknown:
            return SetParametersResult(successful=False, reason=f"there is no parameter {unknown[0]}")
        return super().set_parameters_atomically(parameter_list)

    def missing(self) -> str:
        """The reason why this node waits, logged every few seconds; empty when it does not wait."""
        return ""

    @property
    def finished(self) -> bool:
        """True when the process may end."""
        return bool(self.refused) or self.shut_down or (self.done and bool(self.settings.autostart))

    @property
    def is_new(self) -> bool:
        """True while another node of this kind may not have been discovered yet."""
        return self._age_s < self.look_s

    def close(self) -> int:
        """Log the refused messages and return the exit code; the node can still publish."""
        if self.refusals.counts:
            self.get_logger().warning(f"messages refused or ignored: {self.refusals.summary()}")
        return 0

    def newest_step(self) -> int:
        """The newest step that this node knows of, -1 before the first."""
        return -1

    def health(self) -> Health:
        """Level, sentence and values; refusals, CPU and memory are added."""
        return Health(Level.OK, "running", {})

    def publish_diagnostics(self) -> None:
        """Publish the health of the node: the heartbeat."""
        self._look_for_second()
        lifecycle, k = self.lifecycle, self.newest_step()
        health = Health(Level.OK, lifecycle, {}) if lifecycle == UNCONFIGURED else self.health()
        if lifecycle not in (UNCONFIGURED, ACTIVE) and not self.done:
            health = health._replace(level=Level.OK, sentence=f"{lifecycle}, newest step {k}")
        values = {
            "id": self._id,
            "age_s": self._age_s,
            "lifecycle": lifecycle,
            "last_transition": self.last_transition,
            **health.values,
        }
        values |= {f"refused_{kind}": count for kind, count in sorted(self.refusals.counts.items())}
        values |= {
            "last_refusal": self.refusals.last,
            "cpu_percent": self._cpu_percent.read(100.0 * time.process_time()),
            "memory_MB": f"{memory_mb():.1f}",
        }
        status = DiagnosticStatus(
            level=health.level,
            name=self._full_name,
            message=health.sentence,
            hardware_id=self.get_namespace().strip("/"),
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
        )
        message = DiagnosticArray(status=[status])
        self.grid.set_stamp(message.header.stamp, max(0, k))
        self._diagnostics.publish(message)

    def publisher(self, topic: Topic) -> Publisher:
        """A publisher as the table of topics says."""
        return self.create_publisher(topic.type, topic.name, topic.qos)

    def advertise(self, topic: Topic) -> Publisher:
        """The same; its subscribers are waited for (`unmatched`)."""
        self._advertised[topic] = self.publisher(topic)
        return self._advertised[topic]

    def subscribe(
        self, topic: Topic, receive: Callable[[Any], None], qos: QoSProfile | None = None
    ) -> Subscription:
        """A subscription as the table of topics says, or with another quality of service.

        A message for which `receive` raises `MessageError` is counted as refused.
        """

        def callback(message: Any) -> None:
            try:
                receive(message)
            except MessageError as error:
                self.refusals.add(topic.name, error)

        return self.create_subscription(topic.type, topic.name, callback, topic.qos if qos is None else qos)

    def unmatched(self) -> list[str]:
        """Names of own topics that lack a subscriber of the table, or a recorder that is waited for."""
        recorders = int(getattr(self.settings, "wait_for_recorder", False))
        return [
            topic.name
            for topic, publisher in self._advertised.items()
            if publisher.get_subscription_count() < len(topic.subscribers) + recorders * topic.recorded
        ]

    @property
    def _full_name(self) -> str:
        return f"{self.get_namespace().strip('/')}/{self.get_name()}"

    @property
    def _age_s(self) -> float:
        return time.monotonic() - self._started_at

    def _on_diagnostics(self, message: Any) -> None:
        """While this node is new: end where an older node of this name and namespace is running.

        The publishers of a process that was killed stay in the graph for a while; diagnostics show which nodes run.
        """
        if self._age_s > _NEW_S:
            return
        for status in message.status:
            if status.name != self._full_name:
                continue
            values = {pair.key: pair.value for pair in status.values}
            other, age = values.get("id", self._id), values.get("age_s", "")
            # A status of this name without an age is not of a node of this package.
            with suppress(ValueError):
                if other != self._id and (float(age), other) > (self._age_s, self._id):
                    self._refuse_for(self._full_name)

    def _look_for_second(self) -> None:
        """End before this node works where a node of another name publishes its main topic."""
        if self.MAIN is not None and self.newest_step() < 0:
            own = (self.get_name(), "_NODE_NAME_UNKNOWN_")
            for other in self.get_publishers_info_by_topic(self.resolve_topic_name(self.MAIN.name)):
                if other.node_name not in own:
                    self._refuse_for(other.node_name)

    def _refuse_for(self, other: str) -> None:
        """Take no part, or no longer: the process ends with this sentence."""
        topic = self.resolve_topic_name(self.MAIN.name)
        self.refused = self.refused or (
            f"the node {other} publishes {topic} already: end it first, or give this node another namespace"
        )

    def _log_what_is_missing(self) -> None:
        if self.active and not self.done and (sentence := self.missing()):
            self.get_logger().warning(sentence + self._elsewhere())

    def _elsewhere(self) -> str:
        """The other namespaces in which there is a state, a reference or a command: the partner may be there."""
        own = self.get_namespace().rstrip("/")
        partners = (topics.STATE, topics.REFERENCE_PREVIEW, topics.COMMAND)
        of = {
            (topic.name, topic.of_type(each).type_name)
            for topic in partners
            for each in topic.types or (topic.type,)
        }
        split = [(*name.rpartition("/"), types) for name, types in self.get_topic_names_and_types()]
        found = {
            place or "/"
            for place, _, relative, types in split
            if place != own and any((relative, each) in of for each in types)
        }
        return f"; this is namespace {own or '/'}, others run in {', '.join(sorted(found))}" if found else ""


def given_parameters(node: Node) -> dict[str, Any]:
    """Parameters from the command line and its files, also those that nobody declares."""
    with node.handle:
        given = node.handle.get_parameters(Parameter)
    return {name: parameter.value for name, parameter in given.items()}


def wait_for_subscribers(node: Node, publishers: Iterable[Publisher], longest_s: float) -> None:
    """Wait until the subscribers have acknowledged everything; log where one does not."""
    deadline = time.monotonic() + longest_s
    for publisher in publishers:
        left_s = max(0.0, deadline - time.monotonic())
        if not publisher.wait_for_all_acked(Duration(seconds=left_s)):
            node.get_logger().warning(
                f"a subscriber of {publisher.topic_name} did not acknowledge everything"
            )
