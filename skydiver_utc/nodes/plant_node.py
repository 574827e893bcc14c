# SPDX-License-Identifier: Apache-2.0
"""The plant as a node: in lockstep it steps only on the command that carries its own stamp, else by the clock."""

import json
import sys
import time
import uuid
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.timer import Timer
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from skydiver_utc.loop.outcome import Outcome, OutcomeMonitor
from skydiver_utc.loop.registry import build_disturbances, build_plant
from skydiver_utc.messages import (
    MessageError,
    fill_named,
    fill_odometry,
    outcome_text,
    read_named,
    scenario_text,
)
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.diagnostics import Health, Level, Rate
from skydiver_utc.nodes.lifecycle import RefusedError
from skydiver_utc.nodes.node import ScenarioNode
from skydiver_utc.nodes.process import run
from skydiver_utc.nodes.real_time import CommandAccount, Neutral, RealTimePace
from skydiver_utc.parameters import to_yaml

_STARTUP_POLL_S = 0.02
_PATIENCE_S = 5.0
_DISPLAY_RATE_HZ = 30.0
_PROGRESS_PERIOD_S = 0.5
_LAST_ACKNOWLEDGEMENT_S = 10.0  # the subscribers may need what they missed a second time

# The run went to its last step, or was stopped by the user.
_EXIT_ZERO = (Outcome.COMPLETED, Outcome.ROLLED_OVER, Outcome.ABORTED)


class PlantNode(ScenarioNode):
    """Publishes state k, waits for command k, steps; ends with an outcome.

    `k` is the step whose state was published last, -1 before the run. In real time it waits for command 0 only and
    then steps by the clock (`RealTimePace`).

    Configured it stands at step 0; active it runs; inactive in lockstep it stands still between two steps.
    """

    KIND = topics.PLANT
    MAIN = topics.STATE

    def __init__(
        self,
        context: Context | None = None,
        overrides: Mapping[str, object] | None = None,
        look_s: float = 0.0,
    ) -> None:
        super().__init__(context, overrides, look_s)
        self.k, self.run_id = -1, ""
        self.retransmitted = 0
        self._retries = 0
        self._rate = Rate()
        self._timers_of_run: list[Timer] = []
        self._by_the_clock = self.settings.mode == "real_time"
        self._recorder_ready = not self.settings.wait_for_recorder
        self._pace: RealTimePace | None = None
        self.log_building()
        self._plant = plant = build_plant(self.scenario)
        self._disturbances = build_disturbances(self.scenario, plant)
        self._m = len(plant.control_names)
        applied = plant.initial_applied()
        # Compiled before the run.
        plant.step(plant.initial_state(), applied, plant.actuate(applied[: self._m], applied))
        self._monitor = OutcomeMonitor(self.scenario, plant)
        self._create_publishers()
        qos = topics.EACH_AS_IT_COMES if self._by_the_clock else None
        self._commands = self.subscribe(topics.COMMAND, self.on_command, qos)
        self.subscribe(topics.RECORDER_READY, self.on_recorder_ready)
        self.start_unless_managed()

    def configure(self) -> None:
        """Go to the scenario's beginning, under a new id of the run."""
        plant = self._plant
        self.k, self._retries, self.retransmitted, self.done = -1, 0, 0, False
        self.run_id = uuid.uuid4().hex
        self._monitor = OutcomeMonitor(self.scenario, plant)
        self._state, self._applied = plant.initial_state(), plant.initial_applied()
        self._ready: Any = None  # the command of a step that waits for the end of a pause
        self._pace = self._create_pace() if self._by_the_clock else None
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
            self._timers_of_run = [
                self.every(_STARTUP_POLL_S, self._begin_when_all_are_there),
                self.every(_PATIENCE_S, self._log_what_is_missing),
            ]
            return
        self._retries, self._published_at = 0, now
        if self._ready is not None:
            command, self._ready = self._ready, None
            self._step(command)

    def deactivate(self) -> None:
        """Pause between two steps; a run in real time cannot."""
        if self._pace is not None and self._pace.begun and not self.done:
            raise RefusedError("a run in real time cannot pause: shut the plant down to end it")
        if self.k < 0:
            self._end_timers()

    def cleanup(self) -> None:
        """End a run that is paused."""
        if self.k >= 0:
            self._abort("cleaned up")

    def shutdown(self) -> None:
        """End a run that goes on."""
        self._abort("shut down")

    @property
    def outcome(self) -> Outcome:
        """How the run ended, or stands."""
        return self._monitor.outcome

    @property
    def reason(self) -> str:
        """One sentence on the outcome."""
        return self._monitor.reason

    def newest_step(self) -> int:
        """The step whose state was published last."""
        return self.k

    def health(self) -> Health:
        """Step, rate, and whether commands arrive."""
        commanders = self._commands.get_publisher_count()
        plants = self.count_publishers(self._states.topic_name)
        values: dict[str, object] = {
            "step": self.k,
            "steps": self.scenario.steps,
            "step_rate_Hz": self._rate.read(self.k),
            "retransmitted": self.retransmitted,
            "publishers_of_command": commanders,
            "publishers_of_state": plants,
        }
        pace = self._pace if self._pace is not None and self._pace.begun else None
        if pace is not None:
            values |= {**pace.account.as_dict(), "late_steps": pace.late_steps}
        level, sentence = Level.OK, "running"
        if self.done:
            level = Level.OK if self.outcome in _EXIT_ZERO else Level.ERROR
            sentence = f"{self.outcome.value}: {self.reason}"
        elif commanders > 1 or plants > 1:
            level = Level.ERROR
            sentence = f"{commanders} publishers of command and {plants} of state: there must be one of each"
        elif self.k < 0:
            sentence = f"waiting: there is {self._missing()}"
        elif pace is not None and pace.account.silence:
            level, sentence = Level.WARN, pace.sentence()
        elif self._retries:
            level, sentence = Level.WARN, self._no_command()
        return Health(level, sentence, values)

    def on_recorder_ready(self, _: Any) -> None:
        """The recorder is subscribed to what a run needs."""
        self._recorder_ready = True

    def on_command(self, message: Any) -> None:
        """In lockstep step if this command answers the state published last; in real time keep it."""
        if self.done or self.k < 0:
            return
        k = self.grid.step_of(message.header.stamp)
        if k > self.k:
            raise MessageError("stamp", f"it answers step {k}, the plant is at step {self.k}")
        command = read_named(message, self._plant.control_names)
        if self._pace is not None:
            self._pace.account.receive(k, command)
            if not self._pace.begun and self.active:
                self._begin_by_the_clock()
        elif k < self.k or self._ready is not None:
            # The answer to a state that was retransmitted: the first one was used.
            self.refusals.counts["repeated"] += 1
        elif self.active:
            self._step(command)
        else:
            self._ready = command

    def close(self) -> int:
        """End a run that still goes on, then wait until the subscribers have everything."""
        self._abort("stopped by a signal")
        deadline = time.monotonic() + _LAST_ACKNOWLEDGEMENT_S
        for topic, publisher in self._advertised.items():
            left_s = max(0.0, deadline - time.monotonic())
            if not publisher.wait_for_all_acked(Duration(seconds=left_s)):
                self.get_logger().warning(f"a subscriber of {topic.name} did not acknowledge everything")
        return super().close() or (0 if self.outcome in _EXIT_ZERO else 1)

    def _create_publishers(self) -> None:
        plant = self._plant
        state_type = topics.STATE_TYPES[plant.state_message]
        # Before the clock: a reference that has discovered the clock waits for the scenario, too.
        self._scenarios = self.advertise(topics.SCENARIO)
        self._states = self.advertise(topics.STATE.of_type(state_type))
        self._clocks = self.advertise(topics.CLOCK)
        self._applieds = self.advertise(topics.APPLIED_COMMAND)
        self._joints = self.advertise(topics.JOINT_STATES) if plant.joint_names else None
        self._outcomes = self.advertise(topics.OUTCOME)
        self._state_message = state_type()
        if plant.state_message == "odometry":
            self._state_message.header.frame_id, self._state_message.child_frame_id = "world", "body"
            self._fill_state: Any = fill_odometry
        else:
            self._state_message.name = list(plant.state_names)
            self._fill_state = fill_named
        self._clock_message = Clock()
        self._applied_message = JointState(name=list(plant.control_names))
        self._joints_message = JointState(name=list(plant.joint_names))
        self._display_steps = max(1, round(1.0 / (_DISPLAY_RATE_HZ * self.scenario.dt_s)))
        self._progress_steps = max(1, round(_PROGRESS_PERIOD_S / self.scenario.dt_s))

    def _create_pace(self) -> RealTimePace:
        dt_s = self.scenario.dt_s
        after, ramp = (self.settings.neutral_after_s, self.settings.neutral_time_s)
        neutral = Neutral(self._plant.initial_control(), round(after / dt_s), round(ramp / dt_s))
        account = CommandAccount(self.scenario.steps, neutral)
        return RealTimePace(account, self.scenario.dt_ns, self._step, self._now_ns)

    def _now_ns(self) -> int:
        """The clock of the timers: two steady clocks of a machine drift apart."""
        return int(self._steady_clock.now().nanoseconds)

    def _missing(self) -> str:
        """The nodes and topics that are missing, in words; empty when the run can begin."""
        missing = []
        if not self._recorder_ready:
            missing.append("no recorder that is ready")
        if self._commands.get_publisher_count() == 0:
            missing.append("no publisher of command")
        if unmatched := self.unmatched():
            missing.append(f"no subscriber, or too few, of {', '.join(unmatched)}")
        if not missing and not self._controller_subscribes():
            missing.append("no controller that is subscribed to state")
        return " and ".join(missing)

    def _controller_subscribes(self) -> bool:
        """True when a node that publishes commands is subscribed to the state; other subscribers do not count."""
        commanders = self.get_publishers_info_by_topic(self._commands.topic_name)
        subscribers = self.get_subscriptions_info_by_topic(self._states.topic_name)
        names = {(node.node_namespace, node.node_name) for node in commanders}
        return any((node.node_namespace, node.node_name) in names for node in subscribers)

    def _log_what_is_missing(self) -> None:
        self.get_logger().warning(f"waiting: there is {self._missing() or 'nothing missing'}")

    def _begin_when_all_are_there(self) -> None:
        if self.done or self.k >= 0:  # an executor may call a timer once more that was destroyed
            return
        missing = self._missing()
        if not missing and not self.is_new:
            self._begin()
        elif missing and time.monotonic() - self._began_at > self.settings.startup_timeout_s:
            waited = f"after {self.settings.startup_timeout_s:g} s there was {missing}"
            self._monitor.end(Outcome.NO_COMMAND, waited)
            self._finish()

    def _begin(self) -> None:
        self._end_timers()
        self.k = 0
        self._timers_of_run = [self.every(self.settings.command_timeout_s / 4, self._watch_command)]
        self._began_at = time.monotonic()
        goes_on = self._monitor.observe(0, self._state)
        self._publish_state()
        if not goes_on:
            self._finish()

    def _begin_by_the_clock(self) -> None:
        """Real time: step 0 is now, the others are due by the steady clock."""
        assert self._pace is not None
        self._pace.tick()
        # rclpy rounds the period down to nanoseconds.
        self._timers_of_run.append(self.every((self.scenario.dt_ns + 0.5) * 1e-9, self._tick))

    def _tick(self) -> None:
        if self._pace is not None and self.active and not self.done:
            self._pace.tick()

    def _step(self, command: Any) -> bool:
        """One step; False when the run is over."""
        before, self._applied = self._applied, self._plant.actuate(command, self._applied)
        state = self._plant.step(self._state, before, self._applied)
        for disturbance in self._disturbances:
            state = disturbance.state(self.k + 1, state)
        self._state = state
        goes_on = self._monitor.observe(self.k + 1, state)
        self.k += 1
        self._retries = 0
        self._publish_state()
        self._publish_applied(self.k - 1)
        if not goes_on or self.k == self.scenario.steps:
            self._finish()
        elif self.settings.progress and self.k % self._progress_steps == 0:
            _print({"step": self.k, "steps": self.scenario.steps})
        return not self.done

    def _publish_state(self) -> None:
        """State first: the controller works while the rest is sent."""
        message = self._fill_state(self._state_message, self._state)
        self.grid.set_stamp(message.header.stamp, self.k)
        self._states.publish(message)
        self._published_at = time.monotonic()
        self.grid.set_stamp(self._clock_message.clock, self.k)
        self._clocks.publish(self._clock_message)

    def _publish_applied(self, k: int) -> None:
        self.grid.set_stamp(self._applied_message.header.stamp, k)
        self._applieds.publish(fill_named(self._applied_message, self._applied[: self._m]))
        if self._joints is not None and k % self._display_steps == 0:
            self.grid.set_stamp(self._joints_message.header.stamp, k)
            self._joints.publish(fill_named(self._joints_message, self._plant.joint_angles(self._applied)))

    def _watch_command(self) -> None:
        """Retransmit the state when its command is late; give up after the last retry."""
        timeout_s = self.settings.command_timeout_s
        by_the_clock = self._pace is not None and self._pace.begun
        late = time.monotonic() - self._published_at >= timeout_s
        if self.done or not self.active or by_the_clock or not late:
            return
        if self._retries == self.settings.command_retries:
            last = f"; the last message refused was on {self.refusals.last}" if self.refusals.last else ""
            reason = f"no command for step {self.k} in {timeout_s:g} s, {self._retries + 1} times over{last}"
            self._monitor.end(Outcome.NO_COMMAND, reason)
            self._finish()
            return
        self._retries += 1
        self.retransmitted += 1
        self.get_logger().warning(self._no_command())
        if self.k > 0:
            # A restarted controller continues from here.
            self._publish_applied(self.k - 1)
        self._publish_state()

    def _no_command(self) -> str:
        return f"no command for step {self.k} in {self.settings.command_timeout_s:g} s: its state is retransmitted"

    def _abort(self, how: str) -> None:
        """End a run that has not ended."""
        if not self.done:
            when = "before the run began" if self.k < 0 else f"at step {self.k}"
            self._monitor.end(Outcome.ABORTED, f"{how} {when}")
            self._finish()

    def _finish(self) -> None:
        self.done = True
        wall_time_s = time.monotonic() - self._began_at if self.k >= 0 else 0.0
        self._end_timers()
        values: dict[str, object] = {"wall_time_s": wall_time_s, "states": self.k + 1}
        if self._pace is not None:
            values["real_time"] = self._pace.as_dict()
            self._account_for_silence(self._pace)
        text = outcome_text(self.run_id, self.outcome.value, self.reason, **values)
        self._outcomes.publish(String(data=text))
        self.get_logger().info(f"{self.outcome.value}: {self.reason} ({wall_time_s:.2f} s)")
        if self.settings.progress:
            _print(json.loads(text))

    def _account_for_silence(self, pace: RealTimePace) -> None:
        """Real time: a run whose commands stopped has no command, though it went to its end."""
        account, sentence = pace.account, pace.sentence()
        if self.outcome is Outcome.COMPLETED and account.in_neutral:
            silent_s = account.silence * self.scenario.dt_s
            reason = (
                f"no command answered a state after step {account.newest} for {silent_s:.3f} s to the end"
            )
            self._monitor.end(Outcome.NO_COMMAND, reason)
        elif sentence:
            self._monitor.end(self.outcome, f"{self.reason}; {sentence}")

    def _end_timers(self) -> None:
        for timer in self._timers_of_run:
            self.destroy_timer(timer)
        self._timers_of_run = []


def _print(line: dict[str, object]) -> None:
    """One JSON line on stdout; the run continues when the pipe is closed."""
    with suppress(BrokenPipeError):
        print(json.dumps(line), flush=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the node; returns the exit code."""
    return run(topics.PLANT, arguments)


if __name__ == "__main__":
    sys.exit(main())
