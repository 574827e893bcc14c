"""The scenario's controller as a node: one command for each state, in real time for the newest, with its stamp."""

import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from rclpy.context import Context
from rclpy.subscription import Subscription
from rclpy.timer import Timer

from skydiver_utc.control.protocol import Controller, Status
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.border import BorderError
from skydiver_utc.nodes.diagnostics import Health, Level, Rate
from skydiver_utc.nodes.messages import NamedValuesWriter, Vector, read_named_values, read_state
from skydiver_utc.nodes.polled import take_all
from skydiver_utc.nodes.presence import State
from skydiver_utc.nodes.preview import PreviewStore, read_preview
from skydiver_utc.nodes.scenario_node import ScenarioNode
from skydiver_utc.parameters import ParameterError, Scenario
from skydiver_utc.plant.skydiver import CONTROL_NAMES
from skydiver_utc.simulation.build import build_controller, build_plant, build_reference

_STARTUP_POLL_S = 0.02
_PATIENCE_S = 5.0
_REJOIN_POLL_S = 0.1
# A flight whose last state came this long ago may have been left by a plant that died, or a stranger's state was
# taken for the plant's.
_SAME_FLIGHT_S = 1.0
# After a longer silence the plant holds something else than the last command.
_LONGEST_GAP_S = 0.25


class ControllerNode(ScenarioNode):
    """Answers each state once; listens to the state only when it can answer, which tells the plant to begin.

    `answered` is the step of the last command, -1 before the first. A controller that comes into a flight which
    has begun without it, or has missed much of it, first hears from `applied_command` what the plant holds and
    goes on from there; after `rejoin_wait_s` it begins from the scenario's initial control.

    Configured it is compiled; inactive it answers nothing, and takes in the reference all the same.
    """

    def __init__(self, context: Context | None = None, overrides: Mapping[str, object] | None = None) -> None:
        super().__init__("controller", context, overrides)
        self.answered = -1
        self.passed_over = 0  # states in real time that a newer one had followed already
        self._newest_only = self.own["mode"] == "real_time"
        self._planned = self.scenario.preview_steps  # what the reference node, too, was started for
        self._some_state = build_plant(self.scenario).initial_state()
        self._preview = PreviewStore()
        self._pending: tuple[int, Vector] | None = None
        self._states: Subscription | None = None
        self._held: Subscription | None = None  # applied_command, while this node comes into a flight
        self._startup: Timer | None = None
        self._asked_at = self._answered_at = self._new_state_at = time.monotonic()
        self._asked = False  # since the last answer, or since the reference was missing
        self._status, self._slowest_s, self._rate = Status.SOLVED, 0.0, Rate()
        self._gap_steps = round(_LONGEST_GAP_S / self.scenario.dt_s)
        self._write_command = NamedValuesWriter(self.grid, CONTROL_NAMES).fill
        self._command = np.zeros(len(CONTROL_NAMES))
        self._began_from: Vector | None = None
        self._began_at = 0  # the step of that decision
        self._begins = False  # anew at the next decision, from `_began_from`, None: the initial control
        self._commands = self.advertise(topics.COMMAND)
        self._telemetry = self.advertise(topics.TELEMETRY)
        self.listen(topics.REFERENCE_PREVIEW, self.on_reference)
        self.every(_REJOIN_POLL_S, self._begin_cold_when_nothing_is_heard)
        self.every(_PATIENCE_S, self._say_what_is_missing)
        self.start_unless_managed()

    def configure(self) -> None:
        """A new controller at a flight's beginning, compiled."""
        super().configure()
        self._use(self.rebuilt(self.scenario))
        self._begin_anew(None)
        telemetry_names = (*self._controller.telemetry_names, "solve_time", "status")
        self._write_telemetry = NamedValuesWriter(self.grid, telemetry_names).fill

    def activate(self) -> None:
        """Listen to the state as soon as it can be answered."""
        self._startup = self.every(_STARTUP_POLL_S, self._listen_when_ready)

    def deactivate(self) -> None:
        """Stop listening to the state; the controller's memory is kept."""
        self._end_startup()
        self._end_rejoin()
        self._pending, self._asked = None, False
        if self._states is not None:
            self.destroy_subscription(self._states)
            self._states = None

    def cleanup(self) -> None:
        """Forget the flight."""
        self.answered = -1

    def shutdown(self) -> None:
        """Answer nothing more."""
        self.deactivate()

    def rebuilt(self, scenario: Scenario) -> Controller:
        """The controller of this scenario; it has decided once, so that no flight waits for the compiler."""
        delay_steps = self.own["delay_steps"]
        needs = scenario.preview_steps + delay_steps
        if needs > (most := self._served()):
            raise ParameterError(
                f"the controller would look {needs} steps ahead, the present reference serves {most}: set less, or"
                " start the nodes with it, or the reference node with larger chunk_steps"
            )
        controller = build_controller(scenario, delay_steps)
        controller.decide(self._some_state, build_reference(scenario).preview(0, needs + 1))
        return controller

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
        if self._newest_only and self._states is not None:
            for newer in take_all(self._states):
                self.passed_over += 1
                message = newer
        try:
            k = self.grid.step_of(message.header.stamp)
            if k == self.answered:
                self.refusals.counts["repeated"] += 1
                self._commands.publish(self._write_command(k, self._command))
                return
            self._check_order(k)
            state = read_state(message)
        except BorderError as error:
            self.refusals.add(topics.STATE.name, error)
            return
        if 0 < k < self.answered:
            self.get_logger().warning(f"goes back from step {self.answered} to {k}, where the plant waits")
            self.answered = -1
        if k == 0 and self.answered > 0:
            self.get_logger().info("a new flight begins")
            self._begin_anew(None)
            self.answered = -1
            self._end_rejoin()
        if k < self.scenario.steps:
            self._pending, self._new_state_at = (k, state), time.monotonic()
            self._answer_pending()

    def _check_order(self, k: int) -> None:
        """Refuse a step that the plant cannot be at; raises `BorderError`.

        After a silence any step will do: what was answered last may have been no state of this plant.
        """
        if self.answered < 0 or time.monotonic() - self._answered_at >= _SAME_FLIGHT_S:
            return
        if 0 < k < self.answered:
            raise BorderError("older", f"it is of step {k}, step {self.answered} was answered already")
        if k == 0 and self._states is not None and self._states.get_publisher_count() > 1:
            raise BorderError("second_plant", "it begins a flight, while that of another plant goes on")
        if k > self.answered + 1 and not self._newest_only:
            raise BorderError(
                "ahead", f"it is of step {k}, the plant waits for the answer {self.answered + 1}"
            )

    def on_applied(self, message: Any) -> None:
        """What the plant holds in the flight that this node comes into: go on from there."""
        if self._held is None:
            return
        try:
            k = self.grid.step_of(message.header.stamp)
            control = read_named_values(message, CONTROL_NAMES)
        except BorderError as error:
            self.refusals.add(topics.APPLIED_COMMAND.name, error)
            return
        self.get_logger().info(f"goes on from the command applied at step {k}")
        self._begin_anew(control)
        self._end_rejoin()
        self._answer_pending()

    def newest_step(self) -> int:
        """The step answered last."""
        return self.answered

    def health(self) -> Health:
        """What was answered, how fast, and what is waited for."""
        slowest_s, self._slowest_s = self._slowest_s, 0.0
        values = {
            "answered_step": self.answered,
            "answer_rate_Hz": self._rate.read(self.answered),
            "last_status": self._status.name.lower(),
            "slowest_solve_ms": f"{1e3 * slowest_s:.3f}",
            "passed_over": self.passed_over,
            "reference": self._preview.covered(),
        }
        if waits_for := self._waits_for():
            return Health(Level.WARN if self.answered >= 0 else Level.OK, waits_for, values)
        if self._status is Status.KEPT_PREVIOUS:
            return Health(Level.WARN, "the last decision was not finite: kept the control before", values)
        return Health(Level.OK, "answering", values)

    def _answer_pending(self) -> None:
        if self._pending is None or self._held is not None:
            return
        k, state = self._pending
        if self.live.coming is not None:
            self._change_controller()
        preview = self._preview.window(k, self._needs)
        if preview is None:
            self._asked = False
            return
        if self._comes_into_flight(k):
            self._rejoin(k)
            return
        self._pending, self._asked = None, False
        if self._begins:
            self._tell_beginning(k)
        began_ns = time.perf_counter_ns()
        decision = self._controller.decide(state, preview)
        solve_time_s = (time.perf_counter_ns() - began_ns) * 1e-9
        if self.answered < 0:
            self.serve()
        self.answered, self._answered_at = k, time.monotonic()
        self._status, self._slowest_s = decision.status, max(self._slowest_s, solve_time_s)
        self._command = np.array(decision.control, dtype=np.float64)
        self._commands.publish(self._write_command(k, self._command))
        values = np.append(decision.telemetry, (solve_time_s, float(decision.status)))
        self._telemetry.publish(self._write_telemetry(k, values))

    def _use(self, controller: Controller) -> None:
        self._controller = controller
        self._needs = controller.preview_steps + 1

    def _begin_anew(self, control: Vector | None) -> None:
        """From this control, the initial one without; it is told with the next decision."""
        if control is None:
            self._controller.reset()
        else:
            self._controller.resume(control)
        self._began_from, self._begins = control, True

    def _change_controller(self) -> None:
        """Another controller in the place of this one: it goes on from the command decided last."""
        self._use(self.take_change())
        in_flight = None if self.answered < 0 else self._command
        self._begin_anew(self._began_from if self._begins else in_flight)

    def tell_difference(self) -> None:
        """With the step where this node began to answer; before that it is told with the first answer."""
        if self.answered >= 0 and not self._begins:
            self._tell_beginning(self._began_at)

    def _tell_beginning(self, k: int) -> None:
        self._begins, self._began_at = False, k
        if k > 0 or self.live.changed or self.differs:
            self.tell_change(k, None if self._began_from is None else self._began_from.tolist())

    def _served(self) -> int:
        """Steps ahead that every decision finds in the previews, besides those that were planned at the start.

        A chunk has `planned` + 2 chunk_steps + 1 steps, and the next one comes chunk_steps later.
        """
        chunk_steps = (self._preview.chunk - 1 - self._planned) // 2
        return self._planned + max(int(self.own["delay_steps"]), chunk_steps)

    def _comes_into_flight(self, k: int) -> bool:
        """True where what the plant holds is no longer the command decided last, and it was not asked for yet."""
        return k > 0 and not self._asked and (self.answered < 0 or k - self.answered > self._gap_steps)

    def _rejoin(self, k: int) -> None:
        """Listen to what the plant holds: it says so at each step, and again whenever it sends a state again."""
        self.get_logger().warning(f"comes into a flight at step {k}: asks what command is applied")
        self._held = self.listen(topics.APPLIED_COMMAND, self.on_applied)
        self._asked, self._asked_at = True, time.monotonic()

    def _end_rejoin(self) -> None:
        if self._held is not None:
            self.destroy_subscription(self._held)
            self._held = None

    def _begin_cold_when_nothing_is_heard(self) -> None:
        if self._held is None or time.monotonic() - self._asked_at < self.own["rejoin_wait_s"]:
            return
        self.get_logger().warning("nothing is heard of the applied command: begins from the initial control")
        self._begin_anew(None)
        self._end_rejoin()
        self._answer_pending()

    def _listen_when_ready(self) -> None:
        if self._preview.count >= self._needs and not self.unmatched():
            self._end_startup()
            qos = topics.NEWEST if self._newest_only else None
            self._states = self.listen(topics.STATE, self.on_state, qos=qos)
            self.get_logger().info("ready")

    def _end_startup(self) -> None:
        if self._startup is not None:
            self.destroy_timer(self._startup)
            self._startup = None

    def _waits_for(self) -> str:
        """What an answer waits for, in words; empty when it waits for nothing."""
        waiting = self._pending is not None or self.answered < 0
        if waiting and self._preview.count < self._needs:
            return (
                f"waiting for the reference: it covers {self._preview.covered()}, one decision takes"
                f" {self._needs} steps; is the reference node running, with the same scenario?"
            )
        if self._held is not None:
            return "waiting for the applied command of the flight that it comes into"
        if self._pending is not None:
            sentence = (
                f"waiting for the reference of step {self._pending[0]}: it covers {self._preview.covered()}"
            )
            return "; ".join(filter(None, (sentence, self.presences[topics.REFERENCE].sentence())))
        if waiting and (unheard := self.unmatched()):
            return f"waiting for listeners on {', '.join(unheard)}"
        in_flight = 0 <= self.answered < self.scenario.steps - 1
        silent_s = time.monotonic() - self._new_state_at
        plant = self.presences[topics.PLANT]
        if in_flight and (silent_s > _PATIENCE_S or plant.state is State.DIED):
            return (
                f"no new state after step {self.answered} for {silent_s:.1f} s:"
                f" {plant.sentence() or 'the plant is paused, has stopped or died'};"
                " waiting for a state, of this flight or of a new one"
            )
        return ""

    def _say_what_is_missing(self) -> None:
        if self.active and (waits_for := self._waits_for()):
            self.get_logger().warning(waits_for)
