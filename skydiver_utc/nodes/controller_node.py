# SPDX-License-Identifier: Apache-2.0
"""The controller as a node: one command for each state, in real time for the newest, with the state's stamp."""

import sys
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rcl_interfaces.msg import SetParametersResult
from rclpy.context import Context
from rclpy.parameter import Parameter
from rclpy.subscription import Subscription
from rclpy.timer import Timer
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from skydiver_utc.controllers.protocol import Controller, Status
from skydiver_utc.loop.registry import (
    build_controller,
    build_disturbances,
    build_estimator,
    build_plant,
    build_reference,
    preview_steps,
)
from skydiver_utc.messages import (
    TWIST_COMPONENTS,
    MessageError,
    PreviewStore,
    StepGrid,
    change_text,
    fill_named,
    fill_twist,
    read_named,
    read_odometry,
    read_preview,
)
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.diagnostics import Health, Level, Rate
from skydiver_utc.nodes.node import ScenarioNode
from skydiver_utc.nodes.process import run
from skydiver_utc.parameters import ParameterError, from_yaml, leaves, override
from skydiver_utc.parameters.nanoseconds import stamp_ns

Vector = NDArray[np.float64]

_STARTUP_POLL_S = 0.02
_PATIENCE_S = 5.0


class ControllerNode(ScenarioNode):
    """Answers each state once; subscribes to the state only when it can answer, which lets the plant begin.

    `answered` is the step of the last command, -1 before the first. A controller that begins in a run that goes on
    continues from the newest `applied_command`, where there is one.

    Configured it is compiled; inactive it answers nothing, and takes in the reference all the same. The parameters
    `controller.*` can be set while it runs: from the next decision on another controller continues from the last
    command, and `changes` has a record of it.
    """

    KIND = topics.CONTROLLER
    MAIN = topics.COMMAND

    def __init__(
        self,
        context: Context | None = None,
        overrides: Mapping[str, object] | None = None,
        look_s: float = 0.0,
    ) -> None:
        super().__init__(context, overrides, look_s)
        self.answered = -1
        self.passed_over = 0  # steps in real time without an answer, as a newer state was there
        self._vehicle = self.settings.mode == "vehicle"
        self._status, self._slowest_s, self._rate = Status.SOLVED, 0.0, Rate()
        self._pending: tuple[int, Vector, Any] | None = None  # step, state and stamp that wait for an answer
        self._qos = None if self.settings.mode == "lockstep" else topics.NEWEST
        self._states: Subscription | None = None
        self._applieds: Subscription | None = None  # until the first decision
        self._startup: Timer | None = None
        self._new_state_at = time.monotonic()
        self._start = self.scenario  # what `changes` are counted from
        self._different: dict[str, object] = {}  # given to this node and not to the plant
        self._changed: dict[str, object] = {}
        self._coming: Controller | None = None  # in force from the next decision on
        self._begins, self._began_at = True, 0  # the next decision is the first one; its step
        self._began_from: Vector | None = None  # the applied command that it begins from
        self._applied: Vector | None = None  # the newest applied command
        self.log_building()
        self._plant = build_plant(self.scenario)
        self._reference = build_reference(self.scenario)
        self._preview = PreviewStore(len(self._reference.outputs))
        self._previewed = 0  # steps of the newest preview
        self._estimator = build_estimator(self.scenario, self._plant)
        self._disturbances = () if self._vehicle else build_disturbances(self.scenario, self._plant)
        self._use(self._build(self.scenario))
        self._create_publishers()
        self.subscribe(topics.REFERENCE_PREVIEW, self.on_preview)
        self.subscribe(topics.SCENARIO, self.on_scenario)
        self.add_on_set_parameters_callback(self._on_set_parameters)
        self.every(_PATIENCE_S, self._log_what_is_missing)
        self.start_unless_managed()

    def configure(self) -> None:
        """The controller at a run's beginning."""
        self.answered, self._pending = -1, None
        self._begin(None)
        if self._applieds is None:
            self._applieds = self.subscribe(topics.APPLIED_COMMAND, self.on_applied, self._qos)

    def activate(self) -> None:
        """Subscribe to the state as soon as it can be answered."""
        self._startup = self.every(_STARTUP_POLL_S, self._subscribe_when_ready)

    def deactivate(self) -> None:
        """End the subscription to the state; the controller's memory is kept."""
        self._end_startup()
        self._pending = None
        if self._states is not None:
            self.destroy_subscription(self._states)
            self._states = None

    def shutdown(self) -> None:
        """Answer nothing more."""
        self.deactivate()

    def is_live(self, name: str) -> bool:
        """True for the settings of the controller itself."""
        return name.startswith("controller.")

    def on_preview(self, message: Any) -> None:
        """Keep a preview of the reference; answer the pending state."""
        if self._vehicle and self.grid.exact:
            # The grid of a vehicle's run begins at the first stamp of the reference.
            self.grid = StepGrid(stamp_ns(message.header.stamp), self.scenario.dt_ns, exact=False)
        k0, values = read_preview(message, self.grid, self._reference.outputs)
        self._previewed = len(values)
        self._preview.add(k0, values)
        self._answer()

    def on_state(self, message: Any) -> None:
        """Answer a new state; repeat the command for a retransmitted one; begin anew at step 0."""
        stamp = message.header.stamp
        k = self.grid.step_of(stamp)
        if k == self.answered:
            self.refusals.counts["repeated"] += 1
            self._publish_command(stamp)
            return
        if 0 < k < self.answered:
            raise MessageError("older", f"it is of step {k}, step {self.answered} was answered already")
        state = self._read_state(message)
        if fault := self._plant.fault(state):
            raise MessageError("model", fault)
        if k == 0 and self.answered > 0:
            self.get_logger().info("a new run begins")
            self.answered = -1
            self._begin(None)
        if self._vehicle or k < self.scenario.steps:
            self._pending, self._new_state_at = (k, state, stamp), time.monotonic()
            self._answer()

    def on_applied(self, message: Any) -> None:
        """Keep the applied command; a controller that starts during a run continues from it."""
        self._applied = read_named(message, self._plant.control_names)
        self._answer()

    def on_scenario(self, message: Any) -> None:
        """Compare the plant's scenario, which is the recorded one, with that of this node."""
        try:
            plants = {leaf.name: leaf.value for leaf in leaves(from_yaml(message.data))}
        except ParameterError as error:
            raise MessageError("scenario", str(error)) from error
        self._different = {
            leaf.name: _plain(leaf.value)
            for leaf in leaves(self._start)
            if leaf.name.startswith(("controller.", "plant.")) and leaf.value != plants.get(leaf.name)
        }
        if self.answered >= 0 and self._different:
            self._publish_change(self._began_at, self._began_from)

    def newest_step(self) -> int:
        """The step answered last."""
        return self.answered

    def health(self) -> Health:
        """The newest answer, its rate, and what is missing."""
        slowest_s, self._slowest_s = self._slowest_s, 0.0
        values = {
            "answered_step": self.answered,
            "answer_rate_Hz": self._rate.read(self.answered),
            "last_status": self._status.name.lower(),
            "slowest_solve_ms": f"{1e3 * slowest_s:.3f}",
            "passed_over": self.passed_over,
            "reference": self._preview.covered(),
        }
        if missing := self._missing():
            return Health(Level.WARN if self.answered >= 0 else Level.OK, missing, values)
        if self._status is Status.KEPT_PREVIOUS:
            return Health(Level.WARN, "the last decision was not finite: kept the control before", values)
        return Health(Level.OK, "answering", values)

    def _create_publishers(self) -> None:
        s, names = self.settings, self._plant.control_names
        command_type = topics.COMMAND_TYPES[s.command_message]
        unknown = set(s.command_components) - set(TWIST_COMPONENTS)
        if s.command_message == "twist" and (len(s.command_components) != len(names) or unknown):
            raise ParameterError(
                f"command_components must name a component of the twist for each of {', '.join(names)}:"
                f" {len(names)} of {', '.join(TWIST_COMPONENTS)}"
            )
        self._commands = self.advertise(topics.COMMAND.of_type(command_type))
        self._telemetry = self.advertise(topics.TELEMETRY)
        self._changes = self.advertise(topics.CHANGES)
        self._clocks = self._publisher(topics.CLOCK) if s.publish_clock else None
        self._command_message = command_type()
        if s.command_message == "joint_state":
            self._command_message.name = list(names)
        self._command = np.zeros(len(names))

    def _build(self, scenario: Any) -> Controller:
        """The controller of a scenario; it has decided once, so that no run waits for the compiler."""
        controller = build_controller(scenario, self._plant, self._reference, self.settings.delay_steps)
        preview = self._reference.preview(0, controller.preview_steps + 1)
        controller.decide(self._plant.initial_state(), preview)
        controller.reset()
        return controller

    def _use(self, controller: Controller) -> None:
        self._controller = controller
        self._needs = controller.preview_steps + 1
        self._telemetry_message = JointState(name=[*controller.telemetry_names, "solve_time", "status"])

    def _begin(self, control: Vector | None) -> None:
        """Let the controller begin, from an applied command or as at the start of a run."""
        self._begins, self._began_from = True, control
        self._applied = None
        self._estimator.reset()
        self._held = self._plant.initial_applied()
        if control is None:
            self._controller.reset()
        else:
            self._controller.resume(control)
            self._held[: len(control)] = control

    def _answer(self) -> None:
        """Decide on the pending state, once its preview is complete."""
        if self._pending is None:
            return
        k, state, stamp = self._pending
        preview = self._preview.window(k, self._needs)
        if preview is None or self._waits_for_applied(k):
            return
        self._pending = None
        if self._begins and self.answered < 0 and k > 0 and self._applied is not None:
            self.get_logger().info(f"begins at step {k} from the applied command")
            self._begin(self._applied)
        if self._coming is not None:
            control = self._began_from if self._begins else self._command
            self._use(self._coming)
            self._coming = None
            self._begin(control)
        if self._begins:
            self._begins, self._began_at = False, k
            if k > 0 or self._different or self._changed or self.settings.delay_steps:
                self._publish_change(k, self._began_from)
        self._decide(k, state, preview, stamp)
        if self._applieds is not None:
            self.destroy_subscription(self._applieds)
            self._applieds = None

    def _decide(self, k: int, state: Vector, preview: Vector, stamp: Any) -> None:
        for disturbance in self._disturbances:
            state = disturbance.measurement(k, state)
        estimate = self._estimator.update(state)
        began_ns = time.perf_counter_ns()
        decision = self._controller.decide(estimate, preview)
        solve_time_s = (time.perf_counter_ns() - began_ns) * 1e-9
        self._command = np.array(decision.control, dtype=np.float64)
        self._publish_command(stamp)
        self.passed_over += max(0, k - self.answered - 1) if self.answered >= 0 else 0
        self.answered = k
        self._status, self._slowest_s = decision.status, max(self._slowest_s, solve_time_s)
        self._telemetry_message.header.stamp = stamp
        values = np.append(decision.telemetry, (solve_time_s, float(decision.status)))
        self._telemetry.publish(fill_named(self._telemetry_message, values))
        if self._clocks is not None:
            self._clocks.publish(Clock(clock=stamp))
        self._held = self._plant.actuate(self._command, self._held)
        self._estimator.predict(self._held)

    def _publish_command(self, stamp: Any) -> None:
        message, command = self._command_message, self._command
        match self.settings.command_message:
            case "joint_state":
                message.header.stamp = stamp
                fill_named(message, command)
            case "float64_multi_array":
                message.data = command.tolist()
            case _:
                fill_twist(message, self.settings.command_components, command)
        self._commands.publish(message)

    def _read_state(self, message: Any) -> Vector:
        if self._plant.state_message == "odometry":
            return read_odometry(message, (self.settings.world_frame, self.settings.body_frame))
        return read_named(message, self._plant.state_names)

    def _waits_for_applied(self, k: int) -> bool:
        """True where this controller starts during a run and an applied command is published but not received yet."""
        fresh = self._begins and self.answered < 0 and k > 0
        topic = self.resolve_topic_name(topics.APPLIED_COMMAND.name)
        return fresh and self._applied is None and self.count_publishers(topic) > 0

    def _on_set_parameters(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        """Build the controller of the new values, which are in force from the next decision on."""
        known = {leaf.name: _plain(leaf.value) for leaf in leaves(self.scenario)}
        given = {p.name: _plain(p.value) for p in parameters if self.is_live(p.name)}
        values = {name: value for name, value in given.items() if value != known.get(name)}
        if not values:
            return SetParametersResult(successful=True)
        try:
            scenario = override(self.scenario, values)
            controller = self._build(scenario)
        except ParameterError as error:
            return SetParametersResult(successful=False, reason=str(error))
        if controller.preview_steps + 1 > self._most_preview_steps():
            reason = "the controller would look further ahead than the reference node publishes"
            return SetParametersResult(successful=False, reason=reason)
        self.scenario, self._coming = scenario, controller
        self._changed |= values
        return SetParametersResult(successful=True)

    def _most_preview_steps(self) -> int:
        """Steps that every decision finds in the previews, of which the next comes half of the rest later."""
        started = preview_steps(self._start)
        chunk_steps = (self._previewed - 1 - started) // 2
        return max(self._needs, started + 1 + chunk_steps)

    def _publish_change(self, k: int, control: Vector | None) -> None:
        """Record the values that are not those of the recorded scenario, in force from step k on."""
        values = {**self._different, **self._changed}
        if self.settings.delay_steps:
            values["delay_steps"] = self.settings.delay_steps
        text = ", ".join(f"{name} = {value}" for name, value in values.items()) or "those of the start"
        self.get_logger().info(f"parameters from step {k} on: {text}")
        start = None if control is None else control.tolist()
        self._changes.publish(String(data=change_text(self.KIND, k, values, start)))

    def _subscribe_when_ready(self) -> None:
        # An executor may call a timer once more that was destroyed.
        if self._startup is None or self.is_new:
            return
        if self._previewed >= self._needs and not self.unmatched():
            self._end_startup()
            state = topics.STATE.of_type(topics.STATE_TYPES[self._plant.state_message])
            self._states = self.subscribe(state, self.on_state, self._qos)
            self.get_logger().info("ready")

    def _end_startup(self) -> None:
        if self._startup is not None:
            self.destroy_timer(self._startup)
            self._startup = None

    def _missing(self) -> str:
        """The inputs that are missing for an answer, in words; empty when none is."""
        waiting = self._pending is not None or self.answered < 0
        if waiting and self._previewed < self._needs:
            return (
                f"waiting for the reference: it covers {self._preview.covered()}, one decision takes"
                f" {self._needs} steps; is the reference node running, with the same scenario?"
            )
        if self._pending is not None:
            k = self._pending[0]
            if self._waits_for_applied(k):
                return "waiting for the applied command of the run that it begins in"
            return f"waiting for the reference of step {k}: it covers {self._preview.covered()}"
        if waiting and (unmatched := self.unmatched()):
            return f"waiting for subscribers of {', '.join(unmatched)}"
        silent_s = time.monotonic() - self._new_state_at
        if 0 <= self.answered < self.scenario.steps - 1 and silent_s > _PATIENCE_S:
            return f"no new state after step {self.answered} for {silent_s:.1f} s"
        return ""

    def _log_what_is_missing(self) -> None:
        if self.active and (missing := self._missing()):
            self.get_logger().warning(missing)


def _plain(value: Any) -> Any:
    """The value as YAML would have it."""
    return value if isinstance(value, str) or not hasattr(value, "__len__") else list(value)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the node; returns the exit code."""
    return run(topics.CONTROLLER, arguments)


if __name__ == "__main__":
    sys.exit(main())
