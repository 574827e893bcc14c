# SPDX-License-Identifier: Apache-2.0
"""The controller as a node: one command for each state, in real time for the newest, with the state's stamp."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter
from rclpy.subscription import Subscription
from rosgraph_msgs.msg import Clock

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.protocol import Controller, Status
from skydiver_utc.estimators.true_state import TrueState
from skydiver_utc.loop.build import build_compiled_controller, build_reference, preview_steps
from skydiver_utc.loop.decisions import Decider
from skydiver_utc.messages import (
    TWIST_COMPONENTS,
    MessageError,
    PreviewStore,
    StepGrid,
    fill_fields,
    read_named,
    read_preview,
    read_state,
)
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.answering import AnsweringNode
from skydiver_utc.nodes.diagnostics import Health, Level
from skydiver_utc.nodes.stamped_topic import StampedTopic
from skydiver_utc.parameters import ParameterError, Scenario, override
from skydiver_utc.parameters.nanoseconds import stamp_ns

_WARNINGS = {
    Status.KEPT_PREVIOUS: "the last decision was not finite: kept the control before",
    Status.NOT_REACHED: "the reference has long been out of reach",
    Status.NO_EFFECT: "no control moves one of the outputs inside the horizon",
}


class ControllerNode(AnsweringNode):
    """Answers each state, or estimate, with a command; one that begins in a run that goes on continues from the newest
    `applied_command`, where there is one.

    Configured it is compiled; inactive it answers nothing, and takes in the reference all the same. The parameters
    `controller.*` can be set while it runs: from the next decision on another controller continues from the last
    command, and `changes` has a record of it.
    """

    KIND = topics.CONTROLLER
    MAIN = topics.COMMAND
    LIVE = ("controller.",)

    def build(self) -> None:
        super().build()
        self._vehicle = self.settings.mode == "vehicle"
        self._status = Status.SOLVED
        self._applieds: Subscription | None = None  # until the first decision
        self._coming: Controller | None = None  # in force from the next decision on
        self._applied: Array | None = None  # the newest applied command
        self._reference = build_reference(self.scenario)
        self._preview = PreviewStore(len(self._reference.outputs))
        self._previewed = 0  # steps of the newest preview
        self._command = np.zeros(len(self.plant.control_names))
        self.out = self._advertise_command()
        self._telemetry = StampedTopic(self, topics.TELEMETRY, ())
        self._vehicle_clock = self.publisher(topics.CLOCK) if self.settings.publish_clock else None
        self._decider = Decider(self._build(self.scenario), TrueState(), self.plant, self.disturbance)
        self._use(self._decider.controller)
        self.subscribe(topics.REFERENCE_PREVIEW, self.on_preview)
        self.add_on_set_parameters_callback(self._on_set_parameters)

    def begin_run(self) -> None:
        self._begin(None)
        if self._applieds is None:
            self._applieds = self.subscribe(topics.APPLIED_COMMAND, self.on_applied, self.newest)

    def on_preview(self, message: Any) -> None:
        """Keep a preview of the reference; answer the pending state."""
        if self._vehicle and self.grid.exact:
            # The grid of a vehicle's run begins at the first stamp of the reference.
            self.grid = StepGrid(stamp_ns(message.header.stamp), self.scenario.dt_ns, exact=False)
        k0, values = read_preview(message, self.grid, self._reference.outputs)
        self._previewed = len(values)
        self._preview.add(k0, values)
        self.answer()

    def on_state(self, message: Any) -> None:
        """Answer a state, or estimate."""
        frames = (self.settings.world_frame, self.settings.body_frame)
        state = read_state(message, self.plant.state_names, frames)
        if not self.scenario.has_estimator and (fault := self.plant.fault(state)):
            raise MessageError("model", fault)
        self.receive(message.header.stamp, state)

    def on_applied(self, message: Any) -> None:
        """Keep the applied command; a controller that starts during a run continues from it."""
        self._applied = read_named(message, self.plant.control_names)
        self.answer()

    def health(self) -> Health:
        values = {
            "answered_step": self.answered,
            "answer_rate_Hz": self.rate.read(self.answered),
            "reference": self._preview.covered(),
        }
        if missing := self.missing():
            return Health(Level.WARN if self.answered >= 0 else Level.OK, missing, values)
        if self._status in _WARNINGS:
            return Health(Level.WARN, _WARNINGS[self._status], values)
        return Health(Level.OK, "answering", values)

    def missing(self) -> str:
        waiting = self.pending is not None or self.answered < 0
        if waiting and self._previewed < self._needs:
            return (
                f"waiting for the reference: it covers {self._preview.covered()}, one decision takes"
                f" {self._needs} steps; is the reference node running, with the same scenario?"
            )
        if self.pending is not None:
            k = self.pending[0]
            if self._waits_for_applied(k):
                return "waiting for the applied command of the run that it begins in"
            return f"waiting for the reference of step {k}: it covers {self._preview.covered()}"
        if waiting and (unmatched := self.unmatched()):
            return f"waiting for subscribers of {', '.join(unmatched)}"
        return self.silence()

    def _build(self, scenario: Scenario) -> Controller:
        delay_steps = self.settings.delay_steps
        return build_compiled_controller(scenario, self.plant, self._reference, delay_steps)

    def _use(self, controller: Controller) -> None:
        self._decider.controller = controller
        self._telemetry.message.name = [*self._decider.telemetry_names, "solve_time", "status"]

    def _advertise_command(self) -> StampedTopic:
        """The command in the message that the plant takes."""
        s, names = self.settings, self.plant.control_names
        command = topics.COMMAND.of_type(topics.COMMAND_TYPES[s.command_message])
        if self.scenario.has_estimator:
            command = replace(command, subscribers=(topics.PLANT, topics.ESTIMATOR))
        if s.command_message == "joint_state":
            return StampedTopic(self, command, names)
        if s.command_message == "float64_multi_array":
            return StampedTopic(self, command, names, fill=_fill_data)
        components = s.command_components
        if len(components) != len(names) or not set(components) <= set(TWIST_COMPONENTS):
            raise ParameterError(
                f"command_components must name a component of the twist for each of {', '.join(names)}:"
                f" {len(names)} of {', '.join(TWIST_COMPONENTS)}"
            )
        return StampedTopic(self, command, names, fill=partial(fill_fields, fields=components))

    @property
    def _needs(self) -> int:
        """Steps of the reference for the next decision."""
        return (self._coming or self._decider.controller).preview_steps + 1

    def _begin(self, control: Array | None) -> None:
        """Let the controller begin, from an applied command or as at the start of a run."""
        self.is_first, self.began_from = True, control
        self._applied = None
        self._decider.begin(control)

    def can_answer(self) -> bool:
        """True when the reference of a decision and all subscribers are there."""
        return self._previewed >= self._needs and super().can_answer()

    def subscribe_to_inputs(self) -> list[Subscription]:
        topic = topics.ESTIMATE if self.scenario.has_estimator else topics.STATE
        return [self.subscribe(topic.of_plant(self.plant), self.on_state, self.newest)]

    def answer(self) -> None:
        if self.pending is None:
            return
        k, state, stamp = self.pending
        preview = self._preview.window(k, self._needs)
        if preview is None or self._waits_for_applied(k):
            return
        self.pending = None
        if self.is_first and self.answered < 0 and k > 0 and self._applied is not None:
            self.get_logger().info(f"begins at step {k} from the applied command")
            self._begin(self._applied)
        if self._coming is not None:
            control = self.began_from if self.is_first else self._command
            self._use(self._coming)
            self._coming = None
            self._begin(control)
        if self.is_first:
            self.begins_at(k)
        decision = self._decider.decide(k, state, preview)
        self._command = np.array(decision.control, dtype=np.float64)
        self.out.answer(stamp, self._command)
        self.answered, self._status = k, decision.status
        values = (self._decider.solve_time_s, float(decision.status))
        self._telemetry.answer(stamp, np.append(decision.telemetry, values))
        if self._vehicle_clock is not None:
            self._vehicle_clock.publish(Clock(clock=stamp))
        if self._applieds is not None:
            self.destroy_subscription(self._applieds)
            self._applieds = None

    def _waits_for_applied(self, k: int) -> bool:
        """True where this controller starts during a run and an applied command is published but not received yet."""
        fresh = self.is_first and self.answered < 0 and k > 0
        topic = self.resolve_topic_name(topics.APPLIED_COMMAND.name)
        return fresh and self._applied is None and self.count_publishers(topic) > 0

    def _on_set_parameters(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        """Build the controller of the new values, which are in force from the next decision on."""
        values = self.tuned.news({p.name: p.value for p in parameters if p.name.startswith(self.LIVE)})
        try:
            if values:
                controller = self._build(override(self.tuned.scenario, values))
                if controller.preview_steps + 1 > self._most_preview_steps():
                    raise ParameterError(
                        "the controller would look further ahead than the reference node publishes"
                    )
                self.tuned.change(values)
                self._coming = controller
        except ParameterError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _most_preview_steps(self) -> int:
        """Steps that every decision finds in the previews, of which the next comes half of the rest later."""
        started = preview_steps(self.scenario)
        chunk_steps = (self._previewed - 1 - started) // 2
        return max(self._needs, started + 1 + chunk_steps)


def _fill_data(message: Any, values: Array) -> Any:
    message.data = values.tolist()
    return message
