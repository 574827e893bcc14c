"""From a recording back to the `Flight`, by stamps alone: a stamp is an integer step or an error."""

import json
import math
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.analysis.errors import AnalysisError
from skydiver_utc.analysis.metrics import FLOWN_TO_ITS_END
from skydiver_utc.parameters import ParameterError, Scenario, load_scenario
from skydiver_utc.recording.namespace import namespace_of
from skydiver_utc.recording.reader import RecordedTopic, read_bag
from skydiver_utc.simulation.flight import Flight, ParameterChange
from skydiver_utc.simulation.outcome import Outcome

CONTROL_NAMES = ("Cm_damp_yaw", "k_right", "k_left", "alpha")
# What the controller node adds to the controller's own telemetry.
_SOLVE_TIME, _STATUS = "solve_time", "status"

Floats = NDArray[np.float64]
Topics = Mapping[str, RecordedTopic]


def read_flight(path: Path | str) -> Flight:
    """The flight that a run folder, a bag folder or an .mcap file holds.

    Nothing but the bag is read. Of a message sent twice the first counts. A flight that ended early has the
    steps up to its last complete one; a bag without an outcome gives outcome aborted and an unknown (NaN)
    wall time. A step missing in between raises `AnalysisError`, what is not a bag `RecordingError`.
    Telemetry is not asked for: a step without it is NaN. In real time a state may have no command of
    its own: it has the one before.
    """
    return RecordedFlight(Path(path)).flight()


class _Rows(NamedTuple):
    """Values by step, (steps + 1, width), NaN where `present` (steps + 1,) is False."""

    values: Floats
    present: NDArray[np.bool_]

    @property
    def last(self) -> int:
        """The last step present, -1 without any."""
        steps = np.flatnonzero(self.present)
        return int(steps[-1]) if len(steps) else -1


class RecordedFlight:
    """A recording that is asked for more than its flight."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._topics: Topics = read_bag(path)
        self._namespace = namespace_of(self._topics)
        self.scenario = self._read_scenario()

    def flight(self) -> Flight:
        """What `read_flight` gives."""
        outcome, reason, wall_time_s = self._ending()
        states = self._rows("state", 13, _state)
        commands = self._rows("command", 4, _controls)
        if self.in_real_time():
            commands = _held(commands)
        applied = self._rows("applied_command", 4, _controls)
        reference = self._reference()
        steps = self.scenario.steps
        if outcome not in FLOWN_TO_ITS_END:
            steps = max(0, min(states.last, commands.last + 1, applied.last + 1, reference.last))
        self._refuse_gaps("state", states, steps + 1)
        self._refuse_gaps("reference", reference, steps + 1)
        self._refuse_gaps("command", commands, steps)
        self._refuse_gaps("applied_command", applied, steps)
        names, telemetry, solve_time_s, status = self._telemetry(steps)
        return Flight(
            scenario=self.scenario,
            states=states.values[: steps + 1],
            commands=commands.values[:steps],
            applied=applied.values[:steps],
            reference=reference.values[: steps + 1, 0],
            telemetry=telemetry,
            telemetry_names=names,
            solve_time_s=solve_time_s,
            status=status,
            outcome=outcome,
            reason=reason
            or f"the recording has no outcome, it ends after {steps} of {self.scenario.steps} steps",
            wall_time_s=wall_time_s,
            changes=self.changes(),
        )

    def changes(self) -> tuple[ParameterChange, ...]:
        """Parameters changed in flight, in the order of the steps; of two records of one step the later one."""
        found: dict[tuple[int, str], ParameterChange] = {}
        for message in self._messages("changes"):
            try:
                told = json.loads(message.data)
                control = None if told["control"] is None else tuple(map(float, told["control"]))
                step, node = int(told["step"]), str(told["node"])
                found[step, node] = ParameterChange(node, step, dict(told["parameters"]), control)
            except (ValueError, KeyError, TypeError) as error:
                raise AnalysisError(
                    f"a change of parameters in {self._path} cannot be understood ({error!r}): record the"
                    " flight again"
                ) from error
        return tuple(found[key] for key in sorted(found))

    def previews(self, count: int) -> Floats:
        """The reference (count,) of the first steps as the previews told it, the newest one counts; NaN without."""
        values = np.full(count, np.nan)
        field = "positions" if self.scenario.reference.signal == "alpha" else "velocities"
        for message in self._messages("reference"):
            first = self._step_of("reference", message.header.stamp)
            given = [getattr(point, field)[0] for point in message.points[: max(0, count - first)]]
            values[first : first + len(given)] = given
        return values

    def _messages(self, name: str) -> list[Any]:
        topic = self._topics.get(f"{self._namespace}/{name}")
        return topic.messages if topic else []

    def _read_scenario(self) -> Scenario:
        messages = self._messages("scenario")
        if not messages:
            raise AnalysisError(
                f"{self._path} has no {self._namespace}/scenario, so it is no recording of a flight: give the"
                " folder of one"
            )
        with tempfile.TemporaryDirectory() as folder:
            copy = Path(folder) / "scenario.yaml"
            copy.write_text(messages[-1].data, encoding="utf-8")
            try:
                return load_scenario(str(copy))
            except ParameterError as error:
                raise AnalysisError(
                    f"the scenario in {self._path} is not one of this version ({error}): analyse the"
                    " recording with the version that its versions.json names"
                ) from error

    def _ending(self) -> tuple[Outcome, str, float]:
        """Outcome, reason (empty where none is recorded) and wall time [s]."""
        messages = self._messages("outcome")
        if not messages:
            return Outcome.ABORTED, "", math.nan
        try:
            ending = json.loads(messages[-1].data)
            return Outcome(ending["outcome"]), str(ending["reason"]), float(ending["wall_time_s"])
        except (ValueError, KeyError, TypeError) as error:
            raise AnalysisError(
                f"the outcome in {self._path} cannot be understood ({error!r}): record the flight again"
            ) from error

    def in_real_time(self) -> bool:
        """True where the plant did not wait for commands: a state may have none."""
        messages = self._messages("outcome")
        return bool(messages) and "real_time" in json.loads(messages[-1].data)

    def _rows(self, name: str, width: int, values_of: Callable[[Any], Any]) -> _Rows:
        rows = _Rows(
            np.full((self.scenario.steps + 1, width), np.nan), np.zeros(self.scenario.steps + 1, np.bool_)
        )
        for message in self._messages(name):
            k = self._step_of(name, message.header.stamp)
            if rows.present[k]:
                continue
            values = values_of(message)
            if values is None or len(values) != width:
                raise AnalysisError(
                    f"{self._namespace}/{name} in {self._path} does not hold what it should at step {k}: record"
                    " the flight again with nodes of one version"
                )
            rows.values[k] = values
            rows.present[k] = True
        return rows

    def _step_of(self, name: str, stamp: Any) -> int:
        after_ns = stamp.sec * 1_000_000_000 + stamp.nanosec - self.scenario.stamp_ns(0)
        k, rest = divmod(after_ns, self.scenario.dt_ns)
        if rest or not 0 <= k <= self.scenario.steps:
            raise AnalysisError(
                f"{self._namespace}/{name} in {self._path} has a message {after_ns} ns after the start, which is"
                f" none of the {self.scenario.steps} steps of {self.scenario.dt_ns} ns: fly with one"
                " scenario in all nodes"
            )
        return int(k)

    def _reference(self) -> _Rows:
        """The setpoints; a step without one is taken from the previews."""
        signal = self.scenario.reference.signal
        axis = {"yaw_rate": "z", "pitch_rate": "y"}.get(signal, "")
        field = "velocities" if axis else "positions"
        rows = self._rows("reference/setpoint", 1, lambda message: (getattr(message.twist.angular, axis),))
        if rows.present.all():
            return rows
        for message in self._messages("reference"):
            first = self._step_of("reference", message.header.stamp)
            points = message.points[: self.scenario.steps + 1 - first]
            for k, point in enumerate(points, first):
                if not rows.present[k]:
                    rows.values[k] = getattr(point, field)[0]
                    rows.present[k] = True
        return rows

    def _telemetry(self, steps: int) -> tuple[tuple[str, ...], Floats, Floats, Floats]:
        """Names, values (steps, n), solve times [s] (steps,) and statuses (steps,)."""
        messages = self._messages("controller/telemetry")
        unknown = np.full(steps, np.nan)
        if not messages:
            return (), np.empty((steps, 0)), unknown, unknown
        names = list(messages[0].name)
        rows = self._rows("controller/telemetry", len(names), lambda message: message.position)
        own = [j for j, name in enumerate(names) if name not in (_SOLVE_TIME, _STATUS)]
        solve_time_s, status = (
            rows.values[:steps, names.index(name)] if name in names else unknown
            for name in (_SOLVE_TIME, _STATUS)
        )
        return tuple(names[j] for j in own), rows.values[:steps, own], solve_time_s, status

    def _refuse_gaps(self, name: str, rows: _Rows, count: int) -> None:
        missing = np.flatnonzero(~rows.present[:count])
        if len(missing):
            raise AnalysisError(
                f"{self._namespace}/{name} in {self._path} lacks {len(missing)} of {count} steps, the first is"
                f" step {missing[0]}: record the flight again"
            )


def _held(rows: _Rows) -> _Rows:
    """Each step without a value has that of the step before it."""
    newest = np.maximum.accumulate(np.where(rows.present, np.arange(len(rows.present)), -1))
    return _Rows(rows.values[newest], newest >= 0)


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
