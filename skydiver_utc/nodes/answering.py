# SPDX-License-Identifier: Apache-2.0
"""The base of estimator and controller, which answer each step once."""

import time
from typing import Any

from rclpy.subscription import Subscription
from std_msgs.msg import String

from skydiver_utc.arrays import Array
from skydiver_utc.loop.build import build_disturbances, build_true_plant, model_beside
from skydiver_utc.loop.tuned_scenario import TunedScenario
from skydiver_utc.messages import MessageError, change_text
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.diagnostics import Rate
from skydiver_utc.nodes.node import ScenarioNode
from skydiver_utc.nodes.stamped_topic import StampedTopic
from skydiver_utc.parameters import ParameterError

_PATIENCE_S = 5.0


class AnsweringNode(ScenarioNode):
    """Answers a step with its stamp; subscribes to its `inputs` only when it can answer.

    A step that is retransmitted gets the same answer, step 0 begins a new run, older ones are refused. `answered` is
    the last step answered, -1 before the first; `pending`: step, state and stamp that wait for an answer; `out`: where
    it answers. Where it begins in a run, or with other parameters than the plant, there is a record of it on `changes`.
    """

    out: StampedTopic

    def build(self) -> None:
        self.answered, self.rate, self.received_at = -1, Rate(), time.monotonic()
        self.pending: tuple[int, Any, Any] | None = None
        self.inputs: list[Subscription] = []
        self.get_logger().info("building")
        true_plant = build_true_plant(self.scenario)
        self.plant = model_beside(true_plant, self.scenario)
        # Of what is measured: by the estimator, or else by the controller; a real vehicle has its own.
        measures = (self.KIND == topics.ESTIMATOR) == self.scenario.has_estimator
        measures = measures and self.settings.mode != "vehicle"
        self.disturbance = build_disturbances(self.scenario, true_plant) if measures else None
        self.lockstep = self.settings.mode == "lockstep"
        self.newest = None if self.lockstep else topics.NEWEST  # quality of service of what it answers
        self.tuned = TunedScenario(self.scenario, getattr(self.settings, "delay_steps", 0))
        self.is_first, self._began_at = True, 0  # true until the first answer; the step of that answer
        self.began_from: Array | None = None  # the applied command that it begins from
        self._changes = self.advertise(topics.CHANGES)
        self.subscribe(topics.SCENARIO, self.on_scenario)

    def begin_run(self) -> None:
        """Begin as at the start of a run."""

    def can_answer(self) -> bool:
        """True when all subscribers are there."""
        return not (self.unmatched() or self.is_new)

    def subscribe_to_inputs(self) -> list[Subscription]:
        """Subscribe to what it answers."""
        return []

    def answer(self) -> None:
        """Answer what is pending, once all that it takes is there."""

    def configure(self) -> None:
        """At a run's beginning."""
        self.answered, self.pending = -1, None
        self.begin_run()

    def activate(self) -> None:
        """Subscribe as soon as it can answer."""
        self.begin_when(self.can_answer, self._subscribe)

    def deactivate(self) -> None:
        """End these subscriptions; the memory is kept."""
        super().deactivate()
        self.pending = None
        for subscription in self.inputs:
            self.destroy_subscription(subscription)
        self.inputs = []

    def newest_step(self) -> int:
        return self.answered

    def receive(self, stamp: Any, given: Any) -> None:
        """Answer a new step, repeat the answer to one that is retransmitted, begin anew at step 0."""
        k = self.grid.step_of(stamp)
        if k == self.answered:
            self.refusals.counts["repeated"] += 1
            self.out.repeat(stamp)
            return
        if 0 < k < self.answered:
            raise MessageError("older", f"it is of step {k}, step {self.answered} was answered already")
        if k == 0 and self.answered > 0:
            self.get_logger().info("a new run begins")
            self.configure()
        if not self.grid.exact or k < self.scenario.steps:
            self.pending, self.received_at = (k, given, stamp), time.monotonic()
            self.answer()

    def on_scenario(self, message: Any) -> None:
        """Compare the plant's scenario, which is the recorded one, with that of this node."""
        try:
            different = self.tuned.compare(message.data)
        except ParameterError as error:
            raise MessageError("scenario", str(error)) from error
        if self.answered >= 0 and different:
            self._publish_change()

    def silence(self) -> str:
        """One sentence where no step has come for long, during a run; else empty."""
        silent_s = time.monotonic() - self.received_at
        if 0 <= self.answered < self.scenario.steps - 1 and silent_s > _PATIENCE_S:
            return f"nothing to answer after step {self.answered} for {silent_s:.1f} s"
        return ""

    def begins_at(self, k: int) -> None:
        """Publish a change where this node begins after step 0, or with other parameters than the plant."""
        self.is_first, self._began_at = False, k
        if k > 0 or self.tuned.changes:
            self._publish_change()

    def _subscribe(self) -> None:
        self.inputs = self.subscribe_to_inputs()
        self.get_logger().info("ready")

    def _publish_change(self) -> None:
        """The values that are not those of the recorded scenario, and the control from which it began."""
        values = self.tuned.changes
        text = ", ".join(f"{name} = {value}" for name, value in values.items()) or "those of the start"
        self.get_logger().info(f"parameters from step {self._began_at} on: {text}")
        start = None if self.began_from is None else self.began_from.tolist()
        self._changes.publish(String(data=change_text(self.KIND, self._began_at, values, start)))
