# SPDX-License-Identifier: Apache-2.0
"""The plant as a node: in lockstep it steps only on the command that carries its own stamp, else by the clock."""

import json
import time
import uuid
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
from rclpy.timer import Timer
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from std_srvs.srv import Trigger

from skydiver_utc.errors import FAILED
from skydiver_utc.loop.outcome import REACHED_THE_END, Outcome
from skydiver_utc.loop.plant_steps import PlantSteps, states_to_push
from skydiver_utc.loop.real_time import CommandAccount, RealTimePace
from skydiver_utc.messages import MessageError, outcome_text, read_named, scenario_text
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.diagnostics import Health, Level, Rate
from skydiver_utc.nodes.lifecycle import RefusedError
from skydiver_utc.nodes.node import ScenarioNode, wait_for_subscribers
from skydiver_utc.nodes.plant_display import PlantDisplay
from skydiver_utc.nodes.stamped_topic import StampedTopic, sensor_topic, state_topic
from skydiver_utc.parameters import to_yaml

_PROGRESS_PERIOD_S = 0.5
_LAST_ACKNOWLEDGEMENT_S = 10.0  # the subscribers may need what they missed a second time

_EXIT_ZERO = (*REACHED_THE_END, Outcome.ABORTED)  # the last: stopped by the user


class PlantNode(ScenarioNode):
    """Publishes state k, waits for command k, steps; ends with an outcome.

    In real time it waits for command 0 only and then steps by the clock (`RealTimePace`).

    Configured it stands at step 0; active it runs; inactive in lockstep it stands still between two steps.
    """

    KIND = topics.PLANT
    MAIN = topics.STATE

    def build(self) -> None:
        self.run_id = ""
        self.retransmitted = self._retries = 0
        self._rate = Rate()
        self._progress_steps = max(1, round(_PROGRESS_PERIOD_S / self.scenario.dt_s))
        self._timers_of_run: list[Timer] = []
        self._recorder_ready = not self.settings.wait_for_recorder
        self._real_time = self.settings.mode == "real_time"
        self.get_logger().info("building")
        self.run = PlantSteps(self.scenario)
        plant, acting = self.run.plant, self.run.disturbance.names
        sensors = self.run.sensors.models if self.run.sensors else ()
        # Before the clock: a reference that has discovered the clock waits for the scenario, too.
        self._scenarios = self.advertise(topics.SCENARIO)
        state = replace(topics.STATE, subscribers=()) if sensors else topics.STATE
        self._states = state_topic(self, state, plant)
        self._clocks, self._now = self.advertise(topics.CLOCK), Clock()
        self._applied = StampedTopic(self, topics.APPLIED_COMMAND, plant.control_names)
        self._acted = StampedTopic(self, topics.DISTURBANCE, acting) if acting else None
        self._pushed = StampedTopic(self, topics.PUSHED, plant.state_names)
        self._outcomes = self.advertise(topics.OUTCOME)
        self._sensors = [sensor_topic(self, sensor) for sensor in sensors]
        # What the estimator, or else the controller, is given.
        self._given = (self._sensors[-1] if sensors else self._states).publisher.topic_name
        self._display = PlantDisplay(self, plant)
        qos = topics.EACH_AS_IT_COMES if self._real_time else None
        self._commands = self.subscribe(topics.COMMAND, self.on_command, qos)
        self.subscribe(topics.RECORDER_READY, self.on_recorder_ready)
        self.subscribe(topics.PUSH, self.on_push)
        self.create_service(Trigger, topics.RESET_SERVICE, self.on_reset)
        self._pace = self._new_pace()

    def configure(self) -> None:
        """Go to the scenario's beginning, under a new id of the run."""
        self._retries, self.retransmitted, self.done = 0, 0, False
        self.run_id = uuid.uuid4().hex
        self.run.reset()
        self._command_of_pause: Any = None  # the step that it answers waits for the end of a pause
        self._pace = self._new_pace()
        self._scenarios.publish(String(data=scenario_text(to_yaml(self.scenario), self.run_id)))
        self.get_logger().info(
            f"{self.scenario.steps} steps of {self.scenario.dt_s * 1e3:g} ms,"
            f" {self.settings.mode.replace('_', ' ')}"
        )

    def activate(self) -> None:
        """Begin when all nodes are ready; after a pause step on the command received in it."""
        if self.done:
            raise RefusedError("the run is over: clean up and configure for another one")
        now = time.monotonic()
        if self.k < 0:
            self._began_at = now
            self.begin_when(self._all_are_there, self._begin)
            return
        self._retries, self._published_at = 0, now
        if self._command_of_pause is not None:
            command, self._command_of_pause = self._command_of_pause, None
            self._step(command)

    def deactivate(self) -> None:
        """Pause between two steps; a run in real time cannot."""
        if self._pace.begun and not self.done:
            raise RefusedError("a run in real time cannot pause: shut the plant down to end it")
        super().deactivate()

    def cleanup(self) -> None:
        """End a run that is paused."""
        if self.k >= 0:
            self._abort("cleaned up")

    def shutdown(self) -> None:
        """End a run that goes on."""
        self._abort("shut down")

    @property
    def k(self) -> int:
        """The step whose state was published last, -1 before the run."""
        return self.run.k

    def newest_step(self) -> int:
        return self.k

    def on_recorder_ready(self, _: Any) -> None:
        """The recorder is subscribed to what a run needs."""
        self._recorder_ready = True

    def on_push(self, message: Any) -> None:
        """Add to the states that it names at the next step."""
        states, able = self.run.plant.state_names, states_to_push(self.run.plant)
        if not set(message.name) <= set(able):
            raise MessageError("names", f"it names {list(message.name)}: a push is of {', '.join(able)}")
        change = np.zeros(len(states))
        change[[states.index(name) for name in message.name]] = read_named(message, message.name)
        self.run.push(change)

    def on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Reset the state at the next step of a run that has begun and not ended."""
        response.success = self.k >= 0 and not self.done
        if response.success:
            self.run.reset_state()
        else:
            response.message = "no run goes on: start one, then reset its state"
        return response

    def on_command(self, message: Any) -> None:
        """In lockstep step if this command answers the state published last; in real time keep it."""
        if self.done or self.k < 0:
            return
        k = self.grid.step_of(message.header.stamp)
        if k > self.k:
            raise MessageError("stamp", f"it answers step {k}, the plant is at step {self.k}")
        command = read_named(message, self.run.plant.control_names)
        if self._real_time:
            self._pace.account.receive(k, command)
            if not self._pace.begun and self.active:
                # Step 0 is now, the others are due by the steady clock. rclpy rounds the period down to nanoseconds.
                self._tick()
                self._timers_of_run.append(self.every((self.scenario.dt_ns + 0.5) * 1e-9, self._tick))
        elif k < self.k or self._command_of_pause is not None:
            # The answer to a state that was retransmitted: the first one was used.
            self.refusals.counts["repeated"] += 1
        elif self.active:
            self._step(command)
        else:
            self._command_of_pause = command

    def health(self) -> Health:
        commanders = self._commands.get_publisher_count()
        plants = self.count_publishers(self._states.publisher.topic_name)
        values: dict[str, object] = {
            "step": self.k,
            "steps": self.scenario.steps,
            "step_rate_Hz": self._rate.read(self.k),
            "retransmitted": self.retransmitted,
        }
        if self._pace.begun:
            values |= {**self._pace.account.as_dict(), "late_steps": self._pace.late_steps}
        level, sentence = Level.OK, "running"
        if self.done:
            level = Level.OK if self.run.outcome in _EXIT_ZERO else Level.ERROR
            sentence = f"{self.run.outcome.value}: {self.run.reason}"
        elif commanders > 1 or plants > 1:
            level = Level.ERROR
            sentence = f"{commanders} publishers of command and {plants} of state: there must be one of each"
        elif self.k < 0:
            sentence = self.missing() or "beginning"
        elif self._pace.begun and self._pace.account.silence:
            level, sentence = Level.WARN, self._pace.sentence()
        elif self._retries:
            level, sentence = Level.WARN, self._no_command()
        return Health(level, sentence, values)

    def missing(self) -> str:
        """The nodes and topics that are missing for the run to begin."""
        absent = "" if self.k >= 0 else self._absent()
        return f"waiting: there is {absent}" if absent else ""

    def close(self) -> int:
        """End a run that still goes on, then wait until the subscribers have everything."""
        self._abort("stopped by a signal")
        wait_for_subscribers(self, self._advertised.values(), _LAST_ACKNOWLEDGEMENT_S)
        return super().close() or (0 if self.run.outcome in _EXIT_ZERO else FAILED)

    def _new_pace(self) -> RealTimePace:
        s, dt_s = self.settings, self.scenario.dt_s
        after, ramp = round(s.neutral_after_s / dt_s), round(s.neutral_time_s / dt_s)
        account = CommandAccount(self.scenario.steps, self.run.plant.initial_control(), after, ramp)
        return RealTimePace(account, self.scenario.dt_ns, self._step, self._now_ns)

    def _now_ns(self) -> int:
        """The clock of the timers: two steady clocks of a machine drift apart."""
        return int(self._steady_clock.now().nanoseconds)

    def _absent(self) -> str:
        absent = []
        if not self._recorder_ready:
            absent.append("no recorder that is ready")
        if self._commands.get_publisher_count() == 0:
            absent.append("no publisher of command")
        if unmatched := self.unmatched():
            absent.append(f"no subscriber, or too few, of {', '.join(unmatched)}")
        if not absent and not self._partner_subscribes():
            partner = topics.ESTIMATOR if self.scenario.has_estimator else topics.CONTROLLER
            absent.append(f"no {partner} that is subscribed to {self._given}")
        return " and ".join(absent)

    def _partner_subscribes(self) -> bool:
        """True when a node that publishes estimates or commands is subscribed; other subscribers do not count."""
        answer = topics.ESTIMATE if self.scenario.has_estimator else topics.COMMAND
        partners = self.get_publishers_info_by_topic(self.resolve_topic_name(answer.name))
        subscribers = self.get_subscriptions_info_by_topic(self._given)
        named = [{(node.node_namespace, node.node_name) for node in each} for each in (partners, subscribers)]
        return not named[0].isdisjoint(named[1])

    def _all_are_there(self) -> bool:
        """True when the run can begin; without the others it ends at the time-out."""
        absent = self._absent()
        if absent and time.monotonic() - self._began_at > self.settings.startup_timeout_s:
            waited = f"after {self.settings.startup_timeout_s:g} s there was {absent}"
            self._finish(Outcome.NO_COMMAND, waited)
        return not (absent or self.is_new)

    def _begin(self) -> None:
        self._timers_of_run = [self.every(self.settings.command_timeout_s / 4, self._watch_command)]
        self._began_at = time.monotonic()
        goes_on = self.run.begin()
        self._publish_state()
        self._display.publish(self.k, self.run.state, self.run.applied)
        if not goes_on:
            self._finish()

    def _tick(self) -> None:
        if self.active and not self.done:
            self._pace.tick()

    def _step(self, command: Any) -> bool:
        """One step; False when the run is over."""
        goes_on = self.run.step(command)
        self._retries = 0
        if self.run.pushed is not None:
            self._pushed.publish(self.k, self.run.pushed)
        self._publish_state()
        self._display.publish(self.k, self.run.state, self.run.applied)
        if not goes_on:
            self._finish()
        elif self.settings.progress and self.k % self._progress_steps == 0:
            _print(self._report())
        return goes_on

    def _report(self) -> dict[str, object]:
        """The step in values; `late`: steps of real time that held an older command."""
        plant, account = self.run.plant, self._pace.account
        return {
            "step": self.k,
            "steps": self.scenario.steps,
            "outputs": dict(zip(plant.output_names, plant.outputs(self.run.state).tolist(), strict=True)),
            "controls": dict(zip(plant.control_names, self.run.control.tolist(), strict=True)),
            "late": account.steps - account.on_time if self._real_time else None,
        }

    def _publish_state(self) -> None:
        """The state, and the control that led to it, from which a restarted controller continues.

        State before clock: the controller works while the clock is sent.
        """
        for reading in self.run.readings or ():
            self._sensors[reading.sensor].publish(reading.step, reading.values)
        self._states.publish(self.k, self.run.state)
        self.grid.set_stamp(self._now.clock, self.k)
        self._clocks.publish(self._now)
        if self._acted is not None:
            self._acted.publish(self.k, self.run.disturbance.acted(self.k, self.run.state))
        if self.k > 0:
            self._applied.publish(self.k - 1, self.run.control)
        self._published_at = time.monotonic()

    def _watch_command(self) -> None:
        """Retransmit the state when its command is late; give up after the last retry."""
        timeout_s = self.settings.command_timeout_s
        late = time.monotonic() - self._published_at >= timeout_s
        if self.done or not self.active or self._pace.begun or not late:
            return
        if self._retries == self.settings.command_retries:
            last = f"; the last message refused was on {self.refusals.last}" if self.refusals.last else ""
            reason = f"no command for step {self.k} in {timeout_s:g} s, {self._retries + 1} times over{last}"
            self._finish(Outcome.NO_COMMAND, reason)
            return
        self._retries += 1
        self.retransmitted += 1
        self.get_logger().warning(self._no_command())
        self._publish_state()

    def _no_command(self) -> str:
        return f"no command for step {self.k} in {self.settings.command_timeout_s:g} s: its state is retransmitted"

    def _abort(self, how: str) -> None:
        """End a run that has not ended."""
        if not self.done:
            when = "before the run began" if self.k < 0 else f"at step {self.k}"
            self._finish(Outcome.ABORTED, f"{how} {when}")

    def _finish(self, outcome: Outcome | None = None, reason: str = "") -> None:
        """Publish the outcome: how the run stands, or the one given."""
        self.done = True
        wall_time_s = time.monotonic() - self._began_at if self.k >= 0 else 0.0
        self.end_startup()
        for timer in self._timers_of_run:
            self.destroy_timer(timer)
        self._timers_of_run = []
        if outcome is not None:
            self.run.end(outcome, reason)
        values: dict[str, object] = {"wall_time_s": wall_time_s, "states": self.k + 1}
        if self._real_time:
            values["real_time"] = self._pace.as_dict()
            self.run.end(*self._pace.ending(self.run.outcome, self.run.reason))
        text = outcome_text(self.run_id, self.run.outcome.value, self.run.reason, **values)
        self._outcomes.publish(String(data=text))
        self.get_logger().info(f"{self.run.outcome.value}: {self.run.reason} ({wall_time_s:.2f} s)")
        if self.settings.progress:
            _print(json.loads(text))


def _print(line: dict[str, object]) -> None:
    """One JSON line on stdout; the run continues when the pipe is closed."""
    with suppress(BrokenPipeError):
        print(json.dumps(line), flush=True)
