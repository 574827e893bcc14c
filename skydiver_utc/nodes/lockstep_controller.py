"""The scenario's controller as a node, in lockstep: one command for each state, with the state's stamp."""

import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from rclpy.context import Context

from skydiver_utc.nodes import topics
from skydiver_utc.nodes.border import BorderError
from skydiver_utc.nodes.messages import NamedValuesWriter, Vector, read_state
from skydiver_utc.nodes.preview import PreviewStore, read_preview
from skydiver_utc.nodes.scenario_node import ScenarioNode
from skydiver_utc.plant.skydiver import CONTROL_NAMES
from skydiver_utc.simulation.build import build_controller, build_plant, build_reference

_STARTUP_POLL_S = 0.02
_PATIENCE_S = 5.0


class ControllerNode(ScenarioNode):
    """Answers each state once; listens to the state only when it can answer, which tells the plant to begin.

    `answered` is the step of the last command, -1 before the first.
    """

    def __init__(self, context: Context | None = None, overrides: Mapping[str, object] | None = None) -> None:
        super().__init__("controller", context, overrides)
        self.answered = -1
        self._controller = build_controller(self.scenario)
        self._needs = self._controller.preview_steps + 1
        self._compile()
        self._preview = PreviewStore()
        self._pending: tuple[int, Vector] | None = None
        telemetry_names = (*self._controller.telemetry_names, "solve_time", "status")
        self._write_command = NamedValuesWriter(self.grid, CONTROL_NAMES).fill
        self._write_telemetry = NamedValuesWriter(self.grid, telemetry_names).fill
        self._command = np.zeros(len(CONTROL_NAMES))
        self._commands = self.advertise(topics.COMMAND)
        self._telemetry = self.advertise(topics.TELEMETRY)
        self.listen(topics.REFERENCE_PREVIEW, self.on_reference)
        self._began_at = time.monotonic()
        self._startup = self.every(_STARTUP_POLL_S, self._listen_when_ready)
        self.every(_PATIENCE_S, self._say_what_is_missing)

    def on_reference(self, message: Any) -> None:
        """Keep a chunk of the reference; answer the state that waited for it."""
        try:
            self._preview.add(*read_preview(message, self.grid, self.scenario.reference.signal))
        except BorderError as error:
            self.refusals.add(topics.REFERENCE_PREVIEW.name, error)
            return
        self._answer_pending()

    def on_state(self, message: Any) -> None:
        """Answer a new state; repeat the command for a repeated one; begin anew at a new step 0."""
        try:
            k = self.grid.step_of(message.header.stamp)
            if k == self.answered:
                self.refusals.counts["repeated"] += 1
                self._commands.publish(self._write_command(k, self._command))
                return
            if 0 < k < self.answered:
                raise BorderError("older", f"it is of step {k}, step {self.answered} was answered already")
            state = read_state(message)
        except BorderError as error:
            self.refusals.add(topics.STATE.name, error)
            return
        if k == 0 and self.answered > 0:
            self.get_logger().info("a new flight begins")
            self._controller.reset()
            self.answered = -1
        if k < self.scenario.steps:
            self._pending = (k, state)
            self._answer_pending()

    def _answer_pending(self) -> None:
        if self._pending is None:
            return
        k, state = self._pending
        preview = self._preview.window(k, self._needs)
        if preview is None:
            return
        self._pending = None
        began_ns = time.perf_counter_ns()
        decision = self._controller.decide(state, preview)
        solve_time_s = (time.perf_counter_ns() - began_ns) * 1e-9
        self.answered = k
        self._command = np.array(decision.control, dtype=np.float64)
        self._commands.publish(self._write_command(k, self._command))
        values = np.append(decision.telemetry, (solve_time_s, float(decision.status)))
        self._telemetry.publish(self._write_telemetry(k, values))

    def _compile(self) -> None:
        """Decide once with a controller that is thrown away, so that no flight waits for the compiler."""
        preview = build_reference(self.scenario).preview(0, self._needs)
        build_controller(self.scenario).decide(build_plant(self.scenario).initial_state(), preview)

    def _listen_when_ready(self) -> None:
        if self._preview.count >= self._needs and not self.unmatched():
            self.destroy_timer(self._startup)
            self.listen(topics.STATE, self.on_state)
            self.get_logger().info("ready")

    def _say_what_is_missing(self) -> None:
        waiting = self._pending is not None or self.answered < 0
        if waiting and self._preview.count < self._needs:
            self.get_logger().warning(
                f"waiting for the reference: it covers {self._preview.covered()}, one decision takes"
                f" {self._needs} steps; is the reference node running, with the same scenario?"
            )
        elif waiting and (unheard := self.unmatched()):
            self.get_logger().warning(f"waiting for listeners on {', '.join(unheard)}")
