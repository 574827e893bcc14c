"""From a recording back to the `Flight`, by stamps: a stamp is an integer step, or the message is a stranger's."""

import json
import math
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.analysis.errors import AnalysisError
from skydiver_utc.analysis.metrics import FLOWN_TO_ITS_END
from skydiver_utc.analysis.recorded_steps import RecordedSteps, Rows, Times
from skydiver_utc.parameters import ParameterError, Scenario, from_yaml, override
from skydiver_utc.recording.namespace import namespace_of
from skydiver_utc.recording.reader import RecordedTopic, read_bag
from skydiver_utc.simulation.build import build_changed_reference
from skydiver_utc.simulation.flight import Flight, ParameterChange
from skydiver_utc.simulation.outcome import Outcome

CONTROL_NAMES = ("Cm_damp_yaw", "k_right", "k_left", "alpha")
# What the controller node adds to the controller's own telemetry.
_SOLVE_TIME, _STATUS = "solve_time", "status"

Floats = NDArray[np.float64]
Topics = Mapping[str, RecordedTopic]


def read_flight(path: Path | str) -> Flight:
    """The flight that a run folder, a bag folder or an .mcap file holds.

    Nothing but the bag is read. A flight that ended early has the steps up to its last complete one; a bag
    without an outcome gives outcome aborted and an unknown (NaN) wall time. A recorder that was started in
    flight gives the steps from the first complete one on (`Flight.first_step`). A step missing in between
    raises `AnalysisError`, what is not a bag `RecordingError`. A step that the reference topics do not tell is
    that of the recorded scenario (`RecordedFlight.reference_added`). Messages off the grid, outside of the
    flight or not to be understood are left out (`RecordedFlight.ignored`). Of several of one step the first
    counts that was not sent too early to be the flight's: a command or telemetry before the state that it
    answers, an applied command before the state that it led to, any other message before that of the step
    before. A stranger's message sent just in time cannot be told from the flight's own. Telemetry is not asked
    for: a step without it is NaN. In real time a state may have no command of its own: it has the one before.
    """
    return RecordedFlight(Path(path)).flight()


class RecordedFlight:
    """A recording that is asked for more than its flight."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._topics: Topics = read_bag(path)
        self._namespace = namespace_of(self._topics)
        self.scenario, not_understood = self._read_scenario()
        self._steps = RecordedSteps(self.scenario, self._topics, self._namespace)
        self._steps.count("scenario", not_understood)
        self.reference_added = 0  # steps of the flight asked for last that no message of the reference tells

    def flight(self) -> Flight:
        """What `read_flight` gives."""
        outcome, reason, wall_time_s = self._ending()
        states = self._steps.rows("state", 13, _state)
        commands = self._steps.rows("command", 4, _controls, states.sent_ns)
        if self.in_real_time():
            commands = commands.held()
        led_to_ns = np.append(states.sent_ns[1:], states.sent_ns[-1])
        applied = self._steps.rows("applied_command", 4, _controls, led_to_ns)
        first = max(rows.first or 0 for rows in (states, commands, applied))
        end = self.scenario.steps
        if outcome not in FLOWN_TO_ITS_END:
            end = max(first, min(states.last, commands.last + 1, applied.last + 1))
        self._refuse_gaps("state", states, first, end + 1)
        self._refuse_gaps("command", commands, first, end)
        self._refuse_gaps("applied_command", applied, first, end)
        reference = self._reference(first, end)
        names, telemetry, solve_time_s, status = self._telemetry(first, end, states.sent_ns)
        if not reason:
            lasts = {"state": states.last, "command": commands.last, "applied_command": applied.last}
            reason = self._without_an_outcome(end, lasts)
        return Flight(
            scenario=self.scenario,
            states=states.values[first : end + 1],
            commands=commands.values[first:end],
            applied=applied.values[first:end],
            reference=reference,
            telemetry=telemetry,
            telemetry_names=names,
            solve_time_s=solve_time_s,
            status=status,
            outcome=outcome,
            reason=reason,
            wall_time_s=wall_time_s,
            changes=self.changes(),
            first_step=first,
        )

    @property
    def ignored(self) -> Mapping[str, int]:
        """By topic, how many messages were left out of what was asked for until now."""
        return self._steps.ignored

    def changes(self) -> tuple[ParameterChange, ...]:
        """Parameters changed in flight, in the order of the steps; of two records of one step the later one."""
        found: dict[tuple[int, str], ParameterChange] = {}
        told = [_change(text, self.scenario) for text in _texts(self._steps.messages("changes"))]
        understood = [change for change in told if change]
        self._steps.count("changes", len(told) - len(understood))
        for change in understood:
            found[change.step, change.node] = change
        return tuple(found[key] for key in sorted(found))

    def previews(self, count: int) -> Floats:
        """The reference (count,) of the first steps as the previews told it, the newest one counts; NaN without."""
        values = np.full(count, np.nan)
        field = "positions" if self.scenario.reference.signal == "alpha" else "velocities"
        for first, message in self._steps.with_steps("reference"):
            given = [_first(getattr(point, field)) for point in message.points[: max(0, count - first)]]
            before = values[first : first + len(given)]
            values[first : first + len(given)] = np.where(np.isnan(given), before, given)
        return values

    def told_reference(self) -> Floats:
        """The reference (steps + 1,) by its setpoints, else by the previews; NaN where neither tells."""
        signal = self.scenario.reference.signal
        axis = {"yaw_rate": "z", "pitch_rate": "y"}.get(signal, "")

        def value_of(message: Any) -> Any:
            return (getattr(message.twist.angular, axis),) if axis else None

        rows = self._steps.rows("reference/setpoint", 1, value_of)
        setpoints = rows.values[:, 0]
        if rows.present.all():
            return setpoints
        return np.where(rows.present, setpoints, self.previews(len(setpoints)))

    def own_reference(self, first: int, count: int) -> Floats:
        """The reference (count,) from a step on that the recorded scenario has, with the recorded changes of it."""
        return build_changed_reference(self.scenario, self.changes()).preview(first, count)

    def _reference(self, first: int, end: int) -> Floats:
        told = self.told_reference()[first : end + 1]
        missing = np.isnan(told)
        self.reference_added = int(missing.sum())
        return np.where(missing, self.own_reference(first, len(told)), told) if missing.any() else told

    def _without_an_outcome(self, end: int, lasts: Mapping[str, int]) -> str:
        """Why the flight ends here, and which topics go on."""
        sentence = f"the recording has no outcome, it ends after {end} of {self.scenario.steps} steps"
        longer = [f"{name} to step {last}" for name, last in lasts.items() if last > end]
        return f"{sentence}, the last that all topics have ({', '.join(longer)})" if longer else sentence

    def _read_scenario(self) -> tuple[Scenario, int]:
        """The last one that can be understood of those sent before the flight; of none such, the first at all.

        And how many cannot be understood.
        """
        topic = self._topics.get(f"{self._namespace}/scenario")
        if topic is None or not len(topic):
            raise AnalysisError(
                f"{self._path} has no {self._namespace}/scenario, so it is no recording of a flight: give the"
                " folder of one"
            )
        texts = _texts(topic.readable)
        found = {text: _scenario(text) for text in texts}
        begins_ns = self._first_state_ns()
        sent = list(zip(topic.publish_times_ns, texts, strict=True))
        before = [text for at_ns, text in sent if begins_ns is None or at_ns <= begins_ns]
        after = [text for at_ns, text in sent if begins_ns is not None and at_ns > begins_ns]
        best_first = [found[text] for text in [*reversed(before), *after]]
        for scenario in best_first:
            if isinstance(scenario, Scenario):
                return scenario, sum(not isinstance(found[text], Scenario) for text in texts)
        raise AnalysisError(
            f"the scenario in {self._path} is not one of this version ({best_first[0]}): analyse the"
            " recording with the version that its versions.json names"
        )

    def _first_state_ns(self) -> int | None:
        """When the first state was sent, None without any."""
        topic = self._topics.get(f"{self._namespace}/state")
        sent = zip(topic.publish_times_ns, topic.readable, strict=True) if topic else ()
        return min((int(at_ns) for at_ns, state in sent if state is not None), default=None)

    def _ending(self) -> tuple[Outcome, str, float]:
        """Outcome, reason (empty where none is recorded) and wall time [s]."""
        told = self._told_ending()
        if told is None:
            return Outcome.ABORTED, "", math.nan
        return Outcome(told["outcome"]), str(told["reason"]), float(told["wall_time_s"])

    def _told_ending(self) -> dict[str, Any] | None:
        """The last outcome that can be understood; the others are counted."""
        told = [_outcome(text) for text in _texts(self._steps.messages("outcome"))]
        understood = [one for one in told if one is not None]
        self._steps.count("outcome", len(told) - len(understood))
        return understood[-1] if understood else None

    def in_real_time(self) -> bool:
        """True where the plant did not wait for commands: a state may have none."""
        return "real_time" in (self._told_ending() or {})

    def _telemetry(
        self, first: int, end: int, states_ns: Times
    ) -> tuple[tuple[str, ...], Floats, Floats, Floats]:
        """Names, those of most messages, values (K, n), solve times [s] (K,), statuses (K,), K = end - first."""
        told = (tuple(message.name) for message in self._steps.messages("controller/telemetry") if message)
        common = Counter(names for names in told if {_SOLVE_TIME, _STATUS} <= set(names)).most_common(1)
        unknown = np.full(end - first, np.nan)
        if not common:
            return (), np.empty((end - first, 0)), unknown, unknown
        names = common[0][0]

        def values_of(message: Any) -> Any:
            return message.position if tuple(message.name) == names else None

        rows = self._steps.rows("controller/telemetry", len(names), values_of, states_ns)
        own = [j for j, name in enumerate(names) if name not in (_SOLVE_TIME, _STATUS)]
        solve_time_s, status = (rows.values[first:end, names.index(name)] for name in (_SOLVE_TIME, _STATUS))
        return tuple(names[j] for j in own), rows.values[first:end, own], solve_time_s, status

    def _refuse_gaps(self, name: str, rows: Rows, first: int, end: int) -> None:
        missing = np.flatnonzero(~rows.present[first:end])
        if len(missing):
            raise AnalysisError(
                f"{self._namespace}/{name} in {self._path} lacks {len(missing)} of {end - first} steps, the first"
                f" is step {first + missing[0]}, and nothing else tells them: `skydiver-utc replay` plays what is"
                " there"
            )


def _state(odometry: Any) -> tuple[float, ...]:
    position, attitude = odometry.pose.pose.position, odometry.pose.pose.orientation
    velocity, rates = odometry.twist.twist.linear, odometry.twist.twist.angular
    return (
        *(position.x, position.y, position.z),
        *(attitude.x, attitude.y, attitude.z, attitude.w),
        *(velocity.x, velocity.y, velocity.z),
        *(rates.x, rates.y, rates.z),
    )


def _controls(joint_state: Any) -> Any:
    """The four controls, None where they are not named as they should be."""
    return joint_state.position if tuple(joint_state.name) == CONTROL_NAMES else None


def _texts(messages: Iterable[Any | None]) -> list[str]:
    """What std_msgs/String say; an empty text for bytes that are no message."""
    return ["" if message is None else str(message.data) for message in messages]


def _scenario(text: str) -> Scenario | ParameterError:
    """The scenario of a text, or why it is none."""
    try:
        return from_yaml(text)
    except ParameterError as error:
        return error


def _first(values: Any) -> float:
    """The first value, NaN without any."""
    return float(values[0]) if len(values) else math.nan


def _outcome(text: str) -> dict[str, Any] | None:
    """What an outcome says, None where it cannot be understood."""
    try:
        told = json.loads(text)
        Outcome(told["outcome"]), str(told["reason"]), float(told["wall_time_s"])
    except (ValueError, KeyError, TypeError, RecursionError):
        return None
    return dict(told)


def _change(text: str, scenario: Scenario) -> ParameterChange | None:
    """A change of parameters in this scenario's flight, None where it cannot be understood."""
    try:
        told = json.loads(text)
        control = None if told["control"] is None else tuple(map(float, told["control"]))
        change = ParameterChange(str(told["node"]), int(told["step"]), dict(told["parameters"]), control)
        override(scenario, change.of_scenario)
        fits = all(0 <= number <= scenario.steps for number in (change.step, change.delay_steps))
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError):
        return None
    return change if fits and (control is None or len(control) == len(CONTROL_NAMES)) else None
