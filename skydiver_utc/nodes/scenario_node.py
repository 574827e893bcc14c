"""What all nodes share: parameters from the scenario, topics from the table, refusals counted, diagnostics."""

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import CallbackGroup
from rclpy.context import Context
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from std_msgs.msg import String

from skydiver_utc.nodes import topics
from skydiver_utc.nodes.border import BorderError, Refusals
from skydiver_utc.nodes.diagnostics import Health, Level, ProcessUsage, diagnostic_message
from skydiver_utc.nodes.live_parameters import LiveParameters, differences
from skydiver_utc.nodes.managed import ACTIVE, UNCONFIGURED, ManagedNode
from skydiver_utc.nodes.node_parameters import resolve
from skydiver_utc.nodes.plants_scenario import PlantsScenario
from skydiver_utc.nodes.presence import Presence
from skydiver_utc.nodes.roll_call import Claim, RollCall, read_claim
from skydiver_utc.nodes.seniors_word import LOOK_AGAIN_PERIOD_S
from skydiver_utc.nodes.stamps import StepGrid
from skydiver_utc.nodes.topics import NAMESPACE, Topic
from skydiver_utc.parameters import ParameterError, Scenario, from_yaml

_DIAGNOSTICS_PERIOD_S = 1.0
# Two recorders write into two folders; of all others one is enough.
_ONE_OF_A_KIND = (topics.PLANT, topics.REFERENCE, topics.CONTROLLER)
# Whose process a node watches, to tell a silence from a death.
_WATCHED = {
    topics.PLANT: (topics.CONTROLLER, topics.RECORDER),
    topics.CONTROLLER: (topics.PLANT, topics.REFERENCE),
    topics.REFERENCE: (topics.PLANT,),
    topics.RECORDER: (topics.PLANT,),
}
# Own parameters that make a node's answers and that no scenario has.
_BESIDE_THE_SCENARIO = {topics.CONTROLLER: ("delay_steps",)}


class ScenarioNode(ManagedNode):
    """A node that knows its scenario; `overrides` adds to the parameters given on the command line.

    It is `done` when its work is done. Its process ends, `finished`, when that is so and nobody manages it, when it
    was shut down, or when it was `refused`: one sentence why it must not take part.
    """

    def __init__(
        self, kind: str, context: Context | None = None, overrides: Mapping[str, object] | None = None
    ) -> None:
        super().__init__(kind, NAMESPACE, context)
        try:
            resolved = resolve(kind, self._given_parameters() | dict(overrides or {}))
        except ParameterError:
            self.destroy_node()
            raise
        self._kind = kind
        self.scenario = resolved.scenario
        self.own = resolved.own
        self.grid = StepGrid(resolved.scenario)
        self.refusals = Refusals(self.get_logger().warning)
        self.done = False
        self.refused = ""
        self._advertised: dict[Topic, Publisher] = {}
        self._usage = ProcessUsage()
        self._diagnostics = self._publisher(topics.DIAGNOSTICS)
        self.every(_DIAGNOSTICS_PERIOD_S, self.publish_diagnostics)
        self._alive = self._publisher(topics.ALIVE[kind])
        self.presences = {other: self._watch_process(other) for other in _WATCHED[kind]}
        self._roll_call = self._join(kind) if kind in _ONE_OF_A_KIND else None
        self._changes = self.advertise(topics.CHANGES) if kind in _ONE_OF_A_KIND else None
        self._at_start = resolved.scenario
        self._beside = {name: self.own[name] for name in _BESIDE_THE_SCENARIO.get(kind, ()) if self.own[name]}
        self.differs = dict(self._beside)  # what was given at the start to this node and not to the plant
        self._plants_scenario = PlantsScenario()
        if kind in (topics.CONTROLLER, topics.REFERENCE):
            self.listen(topics.SCENARIO, self.on_scenario)
        self.live = LiveParameters(self, kind, resolved, self.rebuilt, self.change_is_coming)
        changes = "; ".join(resolved.changes) or "as in its file"
        self.get_logger().info(f"scenario {resolved.scenario.name}: {changes}")

    def start_unless_managed(self) -> None:
        """The end of a subclass's start: become active at once where nobody else sees to that."""
        if self.own["autostart"]:
            self.start()

    def configure(self) -> None:
        """What was changed before counts from the beginning."""
        if self.live.coming is not None:
            self.take_change()

    @property
    def finished(self) -> bool:
        """True when the process may end."""
        return bool(self.refused) or self.shut_down or (self.done and bool(self.own["autostart"]))

    def set_parameters_atomically(self, parameter_list: list[Any]) -> SetParametersResult:
        """Set all or none; called by rclpy for each request, which would not say why a parameter is read-only."""
        if sentence := self.live.refusal(parameter_list):
            return SetParametersResult(successful=False, reason=sentence)
        return super().set_parameters_atomically(parameter_list)

    def rebuilt(self, scenario: Scenario) -> Any:
        """What this node needs for a changed scenario; `ParameterError` where it cannot be had."""
        return None

    def change_is_coming(self) -> None:
        """A change of parameters was accepted and waits; by default for the next step."""

    def take_change(self) -> Any:
        """The change that waits is in force from now on; returns what `rebuilt` made for it."""
        change = self.live.take()
        self.scenario = change.scenario
        return change.part

    def on_scenario(self, message: Any) -> None:
        """A scenario was published: that of the plant counts, others are refused."""
        try:
            text = self._plants_scenario.hear(message.data)
        except BorderError as error:
            self.refusals.add(topics.SCENARIO.name, error)
            return
        self._compare_with_plant(text)

    def _compare_with_plant(self, text: str | None) -> None:
        """Compare the plant's scenario, which is the recorded one, with that of this node; None: nothing new."""
        if text is None:
            return
        try:
            plants = from_yaml(text)
        except ParameterError as error:
            self.refusals.add(topics.SCENARIO.name, BorderError("scenario", str(error)))
            return
        differs = {**self._beside, **differences(self._kind, self._at_start, plants)}
        if differs != self.differs:
            self.differs = differs
            self.tell_difference()

    def tell_difference(self) -> None:
        """Record in what this node differs from the plant's scenario, if its part in the flight has begun."""

    def tell_change(self, k: int, control: Sequence[float] | None = None) -> None:
        """Record what differs and was changed, in force from step k on; a controller begins from `control`."""
        values = {**self.differs, **self.live.changed}
        record = {"node": self._kind, "step": k, "parameters": values, "control": control}
        text = ", ".join(f"{name} = {value}" for name, value in values.items()) or "those of the start"
        self.get_logger().info(f"parameters from step {k} on: {text}")
        if self._changes is not None:
            self._changes.publish(String(data=json.dumps(record)))

    def close(self) -> int:
        """Say the last words and return the exit code; the node can still publish."""
        if self.refusals.counts:
            self.get_logger().warning(f"messages refused or ignored: {self.refusals.summary()}")
        return 0

    def newest_step(self) -> int:
        """The newest step that this node knows of, -1 before the first."""
        return -1

    def health(self) -> Health:
        """What the node says about its work; refusals, CPU and memory are added to it."""
        return Health(Level.OK, "running", {})

    def publish_diagnostics(self) -> None:
        """Say how the node is: an own trouble first, else what it refused since the last time."""
        lifecycle = self.lifecycle
        health = Health(Level.OK, lifecycle, {}) if lifecycle == UNCONFIGURED else self.health()
        if lifecycle not in (UNCONFIGURED, ACTIVE) and not self.done:
            health = health._replace(
                level=Level.OK, sentence=f"{lifecycle}, newest step {self.newest_step()}"
            )
        values = {"lifecycle": lifecycle, "last_transition": self.last_transition, **health.values}
        values |= {f"refused_{kind}": count for kind, count in sorted(self.refusals.counts.items())}
        if self._roll_call is not None:
            values["others_told_to_leave"] = self._roll_call.others
        values |= {f"{kind}_process": presence.state.value for kind, presence in self.presences.items()}
        values |= {"last_refusal": self.refusals.last, **self._usage.read()}
        message = diagnostic_message(
            self.grid,
            self.newest_step(),
            self.get_name(),
            self.get_namespace(),
            health._replace(values=values),
        )
        self._diagnostics.publish(message)

    def serve(self) -> None:
        """From now on this node takes part in a flight: another of its kind that comes later has to leave."""
        if self._roll_call is not None:
            self._roll_call.serve()

    @property
    def serves(self) -> bool:
        """True where this node has taken part in a flight."""
        return self._roll_call is not None and self._roll_call.claim.serving

    @property
    def plant_claim(self) -> Claim | None:
        """What the plant says of itself, None before it has named its scenario."""
        return self._plants_scenario.plant

    def fly(self, scenario: str) -> None:
        """From now on the scenario of this text, which is the one on `scenario`, is what this plant flies."""
        if self._roll_call is not None:
            self._roll_call.fly(scenario)

    def refuse(self, sentence: str) -> None:
        """Take no part, or no longer, and end."""
        if not self.done:
            self.refused = sentence
            self.done = True

    def advertise(self, topic: Topic) -> Publisher:
        """A publisher of the flight as the table of topics says: its listeners are waited for."""
        self._advertised[topic] = self._publisher(topic)
        return self._advertised[topic]

    def listen(
        self,
        topic: Topic,
        callback: Callable[[Any], None],
        group: CallbackGroup | None = None,
        qos: QoSProfile | None = None,
    ) -> Subscription:
        """A subscription as the table of topics says, or with a quality of service of its own."""
        qos = topic.qos if qos is None else qos
        return self.create_subscription(topic.type, topic.name, callback, qos, callback_group=group)

    def unmatched(self) -> list[str]:
        """Names of own topics that some listener of the table, or an awaited recorder, does not hear yet."""
        recorders = 1 if self.own.get("wait_for_recorder") else 0
        return [
            topic.name
            for topic, publisher in self._advertised.items()
            if publisher.get_subscription_count() < len(topic.listeners) + recorders * topic.recorded
        ]

    def _publisher(self, topic: Topic) -> Publisher:
        return self.create_publisher(topic.type, topic.name, topic.qos)

    def _watch_process(self, kind: str) -> Presence:
        presence = Presence(kind, self.get_logger().warning)
        topic = topics.ALIVE[kind]
        events = SubscriptionEventCallbacks(liveliness=presence.on_change)
        self.create_subscription(topic.type, topic.name, lambda _: None, topic.qos, event_callbacks=events)
        return presence

    def _join(self, kind: str) -> RollCall:
        def another_is_there() -> bool:
            return bool(self.count_publishers(topics.ALIVE[kind].name) > 1)

        topic = topics.ROLL_CALL
        # Who comes late hears of each node only what it said last, not that it once served no flight.
        claims = self.create_publisher(topic.type, topic.name, topics.LATCHED)
        roll_call = RollCall(kind, claims.publish, another_is_there, self.refuse)
        self.listen(topics.ROLL_CALL, self.on_claim)
        self.every(LOOK_AGAIN_PERIOD_S, roll_call.look_again)
        return roll_call

    def on_claim(self, message: Any) -> None:
        """Another node says that it is there."""
        try:
            claim = read_claim(message.data)
            if self._roll_call is not None:
                self._roll_call.hear(claim)
        except BorderError as error:
            self.refusals.add(topics.ROLL_CALL.name, error)
            return
        self._compare_with_plant(self._plants_scenario.hear_claim(claim))

    def _given_parameters(self) -> dict[str, object]:
        """Parameters from the command line and its files, also those that nobody declares."""
        with self.handle:
            given = self.handle.get_parameters(Parameter)
        return {name: parameter.value for name, parameter in given.items()}
