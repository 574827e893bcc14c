"""The plant as a node: in lockstep it steps only on the command that carries its own stamp, else by the clock."""

import json
import time
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.timer import Timer
from std_msgs.msg import String

from skydiver_utc.nodes import topics
from skydiver_utc.nodes.border import BorderError
from skydiver_utc.nodes.clock_follower import ClockFollower
from skydiver_utc.nodes.clock_leader import ClockLeader, too_many_clocks
from skydiver_utc.nodes.diagnostics import Health, Level, Rate
from skydiver_utc.nodes.managed import TransitionError
from skydiver_utc.nodes.messages import NamedValuesWriter, StateWriter, Vector, read_named_values
from skydiver_utc.nodes.polled import Polled, take_all
from skydiver_utc.nodes.presence import State
from skydiver_utc.nodes.real_time_pace import Answer, RealTimePace
from skydiver_utc.nodes.scenario_node import ScenarioNode
from skydiver_utc.nodes.start_up import StartUp
from skydiver_utc.parameters import Scenario, to_yaml
from skydiver_utc.plant.skydiver import CONTROL_NAMES, SkydiverPlant
from skydiver_utc.simulation.build import build_plant
from skydiver_utc.simulation.outcome import Outcome, OutcomeMonitor

_STARTUP_POLL_S = 0.02
_PATIENCE_S = 5.0
_DISPLAY_RATE_HZ = 30.0
_PROGRESS_PERIOD_S = 0.5
_LAST_ACKNOWLEDGEMENT_S = 10.0  # the listeners may need a second offer of what they missed

# The flight was flown to its last step, or stopped because somebody asked for it.
_EXIT_ZERO = (Outcome.COMPLETED, Outcome.ROLLED_OVER, Outcome.ABORTED)


class PlantNode(ScenarioNode):
    """Publishes state k, waits for command k, steps; ends with an outcome.

    `k` is the step whose state was published last, -1 before the flight. In real time it waits for command 0 only
    and then steps by the clock (`RealTimePace`); commands are drained at each tick, not by the executor.

    Configured it has a body at step 0; active it flies; inactive in lockstep it stands still between two steps.
    """

    def __init__(self, context: Context | None = None, overrides: Mapping[str, object] | None = None) -> None:
        super().__init__("plant", context, overrides)
        self.k = -1
        self.retries = 0
        self.sent_again = 0
        self._rate = Rate()
        self._timers_of_flight: list[Timer] = []
        self._monitor = OutcomeMonitor(self.scenario)
        self._create_publishers()
        self._keeps_time = False  # the flight is done, its clock goes on for others
        self._time = self._create_time()
        self._by_the_clock = self.own["mode"] == "real_time"
        self._real_time: RealTimePace | None = None
        polled, qos = (Polled(), topics.NEWEST) if self._by_the_clock else (None, None)
        self._commands = self.listen(topics.COMMAND, self.on_command, polled, qos)
        self._start_up = StartUp(self, self._commands, self._states, self._time.missing)
        self.listen(topics.RECORDER_READY, self.on_recorder_ready)
        self.start_unless_managed()

    def configure(self) -> None:
        """A new body at the scenario's beginning, compiled."""
        super().configure()
        self._plant = self.rebuilt(self.scenario)
        self._monitor = OutcomeMonitor(self.scenario)
        self._state = self._plant.initial_state()
        self._applied = self._plant.initial_applied()
        self._ready: Vector | None = None  # the command of a step that waits for its time, or in a pause
        self._create_writers()
        self._real_time = self._create_pace() if self._by_the_clock else None
        scenario = to_yaml(self.scenario)
        self.fly(scenario)
        self._scenarios.publish(String(data=scenario))
        mode = "real time" if self._real_time else "lockstep"
        self.get_logger().info(f"{self.scenario.steps} steps of {self.scenario.dt_s * 1e3:g} ms in {mode}")

    def activate(self) -> None:
        """Begin as soon as all others are there; after a pause step on the command that came in it."""
        if self.done:
            raise TransitionError("the flight is over: clean up and configure for another one")
        now = time.monotonic()
        if self.k < 0:
            self._began_at = now
            self._timers_of_flight = [
                self.every(_STARTUP_POLL_S, self._begin_when_heard),
                self.every(_PATIENCE_S, self._start_up.say_what_is_missing),
            ]
            return
        self.retries, self._published_at = 0, now
        self._step_when_it_is_time()

    def deactivate(self) -> None:
        """Pause between two steps; a flight in real time cannot."""
        if self._real_time is not None and self._real_time.begun and not self.done:
            raise TransitionError("a flight in real time cannot pause: shut the plant down to end it")
        if self.k < 0:
            self._end_timers()

    def cleanup(self) -> None:
        """End a flight that is paused, also for those who follow its clock, and be ready for another one."""
        self._time.leave()
        if self.k >= 0:
            self._abort("cleaned up")
        self.k, self.retries, self.sent_again, self.done = -1, 0, 0, False
        self._time.reset()
        self._keeps_time = False

    def shutdown(self) -> None:
        """End a flight that goes on."""
        self._abort("shut down")
        self._time.leave()

    def rebuilt(self, scenario: Scenario) -> SkydiverPlant:
        """The plant of this scenario; it has stepped once, so that no flight waits for the compiler."""
        plant = build_plant(scenario)
        applied = plant.initial_applied()
        plant.step(plant.initial_state(), applied, plant.actuate(applied[:4], applied))
        return plant

    @property
    def finished(self) -> bool:
        """True when the process may end: not while its clock goes on for others."""
        return super().finished and (bool(self.refused) or self.shut_down or not self._keeps_time)

    def refuse(self, sentence: str) -> None:
        """Take no part; a flight that has begun ends with its outcome."""
        if self.done:
            return
        super().refuse(sentence)
        if self.k >= 0:
            self._time.leave()
            self._monitor.end(Outcome.ABORTED, sentence)
            self._finish()

    @property
    def outcome(self) -> Outcome:
        """How the flight ended, or stands."""
        return self._monitor.outcome

    @property
    def reason(self) -> str:
        """One sentence on the outcome."""
        return self._monitor.reason

    def newest_step(self) -> int:
        """The step whose state was published last."""
        return self.k

    def health(self) -> Health:
        """Where the flight stands, at what rate, and whether the commands come."""
        commanders, plants = self._commands.get_publisher_count(), self.count_publishers(topics.STATE.name)
        values: dict[str, object] = {
            "step": self.k,
            "steps": self.scenario.steps,
            "step_rate_Hz": self._rate.read(self.k),
            "late_answers": self.sent_again,
            "publishers_of_command": commanders,
            "publishers_of_state": plants,
            "publishers_of_clock": self.count_publishers(topics.CLOCK.name),
            **self._time.told(),
        }
        if self._real_time is not None and self._real_time.begun:
            values |= {**self._real_time.accounts.told(), "late_steps": self._real_time.late_steps}
        if self.done:
            level = Level.OK if self.outcome in _EXIT_ZERO else Level.ERROR
            return Health(level, f"{self.outcome.value}: {self.reason}", values)
        if commanders > 1 or plants > 1:
            sentence = f"{commanders} publishers of command and {plants} of state: there must be one of each"
            return Health(Level.ERROR, sentence, values)
        if clocks := too_many_clocks(self):
            return Health(Level.ERROR, clocks, values)
        if self.k < 0:
            return Health(Level.OK, f"waiting: there is {self._start_up.phrase()}", values)
        if self._real_time is not None and self._real_time.accounts.silence:
            return Health(Level.WARN, self._and_its_process(self._real_time.sentence()), values)
        if self.retries:
            sentence = f"no command for step {self.k}, its state was sent again"
            return Health(Level.WARN, self._and_its_process(sentence), values)
        gone = [p.sentence() for p in self.presences.values() if p.state is State.DIED]
        return Health(Level.WARN if gone else Level.OK, "; ".join(["flying", *gone]), values)

    def _and_its_process(self, silence: str) -> str:
        """A sentence on missing commands, with what is known of the controller's process."""
        return "; ".join(filter(None, (silence, self.presences[topics.CONTROLLER].sentence())))

    def on_recorder_ready(self, _: Any) -> None:
        """The recorder hears every topic."""
        self._start_up.recorder_ready = True

    def on_command(self, message: Any) -> None:
        """Step if this command answers the state published last; count it otherwise."""
        if self.done:
            return
        answer = self._read_answer(message)
        if answer is None:
            return
        k, command = answer
        if k < self.k or self._ready is not None:
            # The answer to a state that was sent again: it was used the first time.
            self.refusals.counts["repeated"] += 1
            return
        self._ready = command
        if self.active:
            self._step_when_it_is_time()

    def _step_when_it_is_time(self) -> None:
        if self._ready is not None and self._time.await_step(self.k + 1):
            command, self._ready = self._ready, None
            self._step(command)

    def _time_moved(self) -> None:
        """The clock, or a plant that follows it, has told something new."""
        if self.done or self.k < 0:
            return
        if trouble := self._time.trouble():
            self._monitor.end(Outcome.NO_CLOCK, trouble)
            self._finish()
        elif self._real_time is not None:
            self.tick()
        elif self.active:
            self._step_when_it_is_time()

    def _read_answer(self, message: Any) -> Answer | None:
        """The step that a command answers, and the command; None, counted, where it cannot be used."""
        try:
            k = self.grid.step_of(message.header.stamp)
            if k > self.k:
                raise BorderError("stamp", f"it answers step {k}, the plant is at step {self.k}")
            return k, read_named_values(message, CONTROL_NAMES)
        except BorderError as error:
            self.refusals.add(topics.COMMAND.name, error)
            return None

    def tick(self) -> None:
        """Real time: take the commands that have come, step as often as is due."""
        if self.done or not self.active or self._real_time is None:
            return
        answers = [answer for message in take_all(self._commands) if (answer := self._read_answer(message))]
        waited = not self._real_time.begun
        self._real_time.tick(answers, lambda: self._time.may_begin_by_the_clock(1))
        if waited and self._real_time.begun and not self.done:
            self.destroy_timer(self._timers_of_flight.pop())
            if not self._follows:
                # In phase with the deadlines: the timer so far may wake up just before each of them.
                self._timers_of_flight.append(self._tick_each_step())
            self._time.await_step(1)

    @property
    def _follows(self) -> bool:
        return isinstance(self._time, ClockFollower)

    def _create_time(self) -> ClockLeader | ClockFollower:
        if self.own["clock"] == "follow":
            return ClockFollower(self, self._time_moved, self.refuse)
        assert self._roll_call is not None
        return ClockLeader(self, self._roll_call.claim, self._time_moved, self.refuse)

    def _now_ns(self) -> int:
        """What the steps of real time are due by: the steady clock, or the one that is followed."""
        if self._follows:
            return (self._time.k + 1) * self.grid.dt_ns
        return int(self._steady_clock.now().nanoseconds)

    def _create_pace(self) -> RealTimePace:
        return RealTimePace(
            self.scenario,
            self._plant.initial_control(),
            self.own["neutral_after_s"],
            self.own["neutral_rate_rad_s"],
            self._step_in_real_time,
            self._now_ns,
        )

    def _tick_each_step(self) -> Timer:
        # rclpy rounds the period down to nanoseconds.
        return self.every((self.scenario.dt_ns + 0.5) * 1e-9, self.tick)

    def _step_in_real_time(self, command: Vector) -> bool:
        self._step(command)
        return not self.done

    def close(self) -> int:
        """End a flight that still goes on, then wait until the listeners have everything."""
        if self.refused and self.k < 0:
            return super().close()
        if not self.refused:
            self._abort("stopped by a signal")
            self._time.leave()
        deadline = time.monotonic() + _LAST_ACKNOWLEDGEMENT_S
        for topic, publisher in self._advertised.items():
            left_s = max(0.0, deadline - time.monotonic())
            if not publisher.wait_for_all_acked(Duration(seconds=left_s)):
                self.get_logger().warning(f"a listener of {topic.name} did not acknowledge everything")
        return super().close() or (0 if self.outcome in _EXIT_ZERO else 1)

    def _abort(self, how: str) -> None:
        """End a flight that has not ended."""
        if not self.done:
            when = "before the flight began" if self.k < 0 else f"at step {self.k}"
            self._monitor.end(Outcome.ABORTED, f"{how} {when}")
            self._finish()

    def _create_writers(self) -> None:
        self._write_state = StateWriter(self.grid).fill
        self._write_applied = NamedValuesWriter(self.grid, CONTROL_NAMES).fill
        self._write_joints = NamedValuesWriter(self.grid, self._plant.joint_names).fill
        self._display_steps = max(1, round(1.0 / (_DISPLAY_RATE_HZ * self.scenario.dt_s)))
        self._progress_steps = max(1, round(_PROGRESS_PERIOD_S / self.scenario.dt_s))

    def _create_publishers(self) -> None:
        self._states = self.advertise(topics.STATE)
        self._applieds = self.advertise(topics.APPLIED_COMMAND)
        self._joints = self.advertise(topics.JOINT_STATES)
        self._outcomes = self.advertise(topics.OUTCOME)
        self._scenarios = self.advertise(topics.SCENARIO)

    def _begin_when_heard(self) -> None:
        if self.done:
            return
        if not self._start_up.missing() and self._time.await_step(0):
            self._begin()
        elif time.monotonic() - self._began_at > self.own["startup_timeout_s"]:
            waited = self.own["startup_timeout_s"]
            self._monitor.end(Outcome.NO_COMMAND, f"after {waited:g} s there was {self._start_up.phrase()}")
            self._finish()

    def _begin(self) -> None:
        self._end_timers()
        self.serve()
        if self._roll_call is not None:
            self._time.serve(self._roll_call.claim)
        self.k = 0
        self._timers_of_flight = [self.every(self.own["command_timeout_s"] / 4, self._watch_command)]
        if self._real_time is not None:
            self._timers_of_flight.append(self._tick_each_step())
        self._began_at = time.monotonic()
        goes_on = self._monitor.observe(0, self._state)
        self._publish_state()
        if not goes_on:
            self._finish()

    def _step(self, command: Vector) -> None:
        if self.live.coming is not None:
            self._plant = self.take_change()
            self.tell_change(self.k)
        before, self._applied = self._applied, self._plant.actuate(command, self._applied)
        self._state = self._plant.step(self._state, before, self._applied)
        goes_on = self._monitor.observe(self.k + 1, self._state)
        self.k += 1
        self.retries = 0
        self._publish_state()
        self._publish_applied(self.k - 1)
        if not goes_on or self.k == self.scenario.steps:
            self._finish()
        elif self.own["progress"] and self.k % self._progress_steps == 0:
            self._report({"step": self.k, "steps": self.scenario.steps})

    def _publish_state(self) -> None:
        """State first: the controller works while the rest is sent."""
        self._states.publish(self._write_state(self.k, self._state))
        self._published_at = time.monotonic()
        self._time.show(self.k)

    def _publish_applied(self, k: int) -> None:
        self._applieds.publish(self._write_applied(k, self._applied[:4]))
        if k % self._display_steps == 0:
            angles = self._plant.joint_angles(float(self._applied[3]))
            self._joints.publish(self._write_joints(k, angles))

    def _watch_command(self) -> None:
        """Send the state again when its command is late; give up after the last retry."""
        timeout_s = self.own["command_timeout_s"]
        by_the_clock = self._real_time is not None and self._real_time.begun
        if self._time.trouble():
            self._time_moved()
        answered = by_the_clock or self._ready is not None
        if self.done or not self.active or answered or time.monotonic() - self._published_at < timeout_s:
            return
        if self.retries == self.own["command_retries"]:
            last = f"; the last message refused was on {self.refusals.last}" if self.refusals.last else ""
            reason = f"no command for step {self.k} in {timeout_s:g} s, {self.retries + 1} times over{last}"
            self._monitor.end(Outcome.NO_COMMAND, self._and_its_process(reason))
            self._finish()
            return
        self.retries += 1
        self.sent_again += 1
        late = f"no command for step {self.k} in {timeout_s:g} s: sending its state again"
        self.get_logger().warning(self._and_its_process(late))
        if self.k > 0:
            # A controller that was started again goes on from here.
            self._applieds.publish(self._write_applied(self.k - 1, self._applied[:4]))
        self._publish_state()

    def _finish(self) -> None:
        self.done = True
        wall_time_s = time.monotonic() - self._began_at if self.k >= 0 else 0.0
        self._end_timers()
        report = self._outcome_report(wall_time_s)
        self._outcomes.publish(String(data=json.dumps(report)))
        self.get_logger().info(f"{self.outcome.value}: {self.reason} ({wall_time_s:.2f} s)")
        if self.own["progress"]:
            self._report(report)
        begun = self._real_time is not None and self._real_time.begun
        self._keeps_time = True
        self._time.end(self._leave, self._real_time.due_step if self._real_time and begun else None)

    def _leave(self) -> None:
        self._keeps_time = False

    def _outcome_report(self, wall_time_s: float) -> dict[str, object]:
        """What the outcome says; in real time with the account of every step."""
        report: dict[str, object] = {"outcome": self.outcome.value, "reason": self.reason}
        pace = self._real_time
        if pace is not None:
            if self.outcome is Outcome.COMPLETED and (silence := pace.silence_sentence()):
                self._monitor.end(Outcome.NO_COMMAND, self._and_its_process(silence))
            elif sentence := pace.sentence():
                self._monitor.end(self.outcome, f"{self.reason}; {sentence}")
            report = {"outcome": self.outcome.value, "reason": self.reason, "real_time": pace.told()}
        return report | {"wall_time_s": wall_time_s, "states": self.k + 1}

    def _end_timers(self) -> None:
        for timer in self._timers_of_flight:
            self.destroy_timer(timer)
        self._timers_of_flight = []

    def _report(self, line: dict[str, object]) -> None:
        """One line on stdout; the flight goes on when nobody reads it any more."""
        with suppress(BrokenPipeError):
            print(json.dumps(line), flush=True)
