# SPDX-License-Identifier: Apache-2.0
"""From a recording back to the `Run`, message by message on the grid of steps."""

import json
import math
from collections import Counter
from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from skydiver_utc.analysis.recorded_steps import RecordedSteps, Rows, stretches
from skydiver_utc.arrays import Array
from skydiver_utc.errors import AnalysisError, OwnClassError
from skydiver_utc.estimators.consistency import JUDGEMENT
from skydiver_utc.estimators.protocol import Reading
from skydiver_utc.loop.build import build_disturbances, build_reference, build_sensors, build_true_plant
from skydiver_utc.loop.outcome import REACHED_THE_END, Outcome
from skydiver_utc.loop.run import ParameterChange, Run
from skydiver_utc.messages import (
    MessageError,
    read_fields,
    read_outcome,
    read_preview,
    read_state,
    run_id_of,
)
from skydiver_utc.parameters import ParameterError, Scenario, from_yaml, leaves, override
from skydiver_utc.recording.reader import RecordedTopic, namespace_of, read_bag

# What the controller node adds to the controller's own telemetry.
_SOLVE_TIME, _STATUS = "solve_time", "status"

Topics = Mapping[str, RecordedTopic]


def read_run(path: Path | str) -> Run:
    """The run that a run folder, a bag folder or an .mcap file holds, from the first complete step to the last one.

    Steps missing in between are NaN (`Run.holes`), as are telemetry and wall time that are not recorded; without an
    outcome it is aborted; in real time a step without a command has the one before. A run without a step raises
    `AnalysisError`, a path that is no bag `RecordingError`. The scenario's own reference stands where none is recorded
    (`RecordedRun.reference_added`), and messages that cannot be used are left out (`RecordedRun.ignored`).
    """
    return RecordedRun(Path(path)).run()


class RecordedRun:
    """A recording: its scenario, plant, reference, run, and the previews that the controller received."""

    def __init__(self, path: Path) -> None:
        self._path = path
        topics: Topics = read_bag(path)
        self._namespace = namespace_of(topics)
        self.scenario, self.run_id, unusable = self._read_scenario(topics)
        self.plant, self.reference = build_true_plant(self.scenario), build_reference(self.scenario)
        self._steps = RecordedSteps(self.scenario, topics, self._namespace)
        if unusable:
            self._steps.ignored["scenario"] = unusable
        self.reference_revised = 0  # see `previews`
        self.reference_added = 0  # steps of the run made last whose reference is not recorded
        self._ending = self._read_ending()
        self.changes = self._read_changes()

    def run(self) -> Run:
        """The same as `read_run`."""
        outcome = Outcome(self._ending.get("outcome", Outcome.ABORTED))
        states = self._steps.rows("state", len(self.plant.state_names), self._state)
        commands = self._steps.named("command", self.plant.control_names)
        if self.in_real_time:
            commands = commands.held()
        applied = self._steps.named("applied_command", self.plant.control_names)
        first = max(rows.first for rows in (states, commands, applied))
        end = self.scenario.steps
        if outcome not in REACHED_THE_END:
            end = max(first, min(states.last, commands.last + 1, applied.last + 1))
        self._refuse_none("state", states)
        if end > first:
            self._refuse_none("command", commands)
            self._refuse_none("applied_command", applied)
        absent = ~states.present[first : end + 1]
        absent[:-1] |= ~(commands.present & applied.present)[first:end]
        names, telemetry = self._telemetry("controller/telemetry", first, end, (_SOLVE_TIME, _STATUS))
        of_estimator, estimated = self._telemetry("estimator/telemetry", first, end, ())
        acting = build_disturbances(self.scenario, self.plant).names
        acted = self._steps.named("disturbance", acting)
        pushes = self._steps.named("pushed", self.plant.state_names)
        pushed = np.flatnonzero(np.nan_to_num(pushes.values).any(axis=0))
        own = [j for j, name in enumerate(names) if name not in (_SOLVE_TIME, _STATUS)]
        sensors = getattr(self.scenario.estimator, "sensors", None) or ()
        judged = {f"{name}_{sensor}" for name in JUDGEMENT for sensor in sensors}
        own_estimated = [j for j, name in enumerate(of_estimator) if name not in judged]
        unknown = np.full(end - first, np.nan)
        reference, self.reference_added = self.filled(self.setpoints()[first : end + 1], first)
        lasts = {"state": states.last, "command": commands.last, "applied_command": applied.last}
        return Run(
            scenario=self.scenario,
            plant=self.plant,
            states=states.values[first : end + 1],
            commands=commands.values[first:end],
            applied=applied.values[first:end],
            reference=reference,
            tracked_names=self.reference.outputs,
            amplitude=self.reference.amplitude,
            telemetry=np.hstack((telemetry[:, own], estimated[:, own_estimated])),
            telemetry_names=(*(names[j] for j in own), *(of_estimator[j] for j in own_estimated)),
            solve_time_s=telemetry[:, names.index(_SOLVE_TIME)] if names else unknown,
            status=telemetry[:, names.index(_STATUS)] if names else unknown,
            outcome=outcome,
            reason=self._ending.get("reason") or self._without_an_outcome(end, lasts),
            wall_time_s=self._ending.get("wall_time_s", math.nan),
            changes=self.changes,
            disturbance=np.hstack([acted.values, np.nan_to_num(pushes.values[:, pushed])])[first : end + 1],
            disturbance_names=(*acting, *(f"push_{self.plant.state_names[i]}" for i in pushed)),
            first_step=first,
            holes=tuple((first + begin, first + end) for begin, end in stretches(absent)),
        )

    @property
    def ignored(self) -> Mapping[str, int]:
        """By topic, how many messages were left out of what was read until now."""
        return {name: count for name, count in self._steps.ignored.items() if count}

    @property
    def in_real_time(self) -> bool:
        """True where the plant did not wait for commands: a state may have none."""
        return "real_time" in self._ending

    def previews(self, count: int) -> Array:
        """The reference (count, l) of the first steps by the previews, the newest one counts; NaN without.

        `reference_revised` becomes the number of steps to which two previews give different values.
        """
        outputs = self.reference.outputs
        values = np.full((count, len(outputs)), np.nan)
        revised = np.zeros(count, np.bool_)
        for k, rows in self._steps.read("reference", lambda m: read_preview(m, self._steps.grid, outputs)):
            fitting = rows[: max(0, count - k)]
            before = values[k : k + len(fitting)]
            revised[k : k + len(fitting)] |= (~np.isnan(before) & (before != fitting)).any(axis=1)
            values[k : k + len(fitting)] = fitting
        self.reference_revised = int(revised.sum())
        return values

    def setpoints(self) -> Array:
        """The reference (steps + 1, l) by its setpoints, else by the previews; NaN where neither has it."""
        rows = self._steps.named("reference/setpoint", self.reference.outputs)
        if rows.present.all():
            return rows.values
        return np.where(rows.present[:, np.newaxis], rows.values, self.previews(len(rows.values)))

    def estimates(self, run: Run) -> Array:
        """The estimates (K, n) of the run; a step without one has that of the step before."""
        rows = self._steps.rows("estimate", len(self.plant.state_names), self._state).held()
        self._refuse_none("estimate", rows)
        return rows.values[run.first_step : run.first_step + len(run.commands)]

    def measured(self, run: Run) -> Any:
        """The estimator's measurements from the run's first step on: the states, or the readings of each step."""
        sensors = build_sensors(self.scenario, self.plant)
        if sensors is None:
            return run.states
        rows = [
            self._steps.rows(
                f"sensors/{s.name}", s.size, partial(read_fields, fields=s.fields, names=s.names)
            )
            for s in sensors.models
        ]
        arrived = (sensors.arrivals(k) for k in range(run.first_step + len(run.states)))
        readings = [
            [Reading(i, step, rows[i].values[step]) for i, step in of_step if rows[i].present[step]]
            for of_step in arrived
        ]
        return readings[run.first_step :]

    def _state(self, message: Any) -> Array:
        return read_state(message, self.plant.state_names)

    def filled(self, values: Array, first: int) -> tuple[Array, int]:
        """A reference (K, l) from a step on with the scenario's own values for what is NaN; in how many steps."""
        missing = np.isnan(values)
        if missing.any():
            values = np.where(missing, self.reference.preview(first, len(values)), values)
        return values, int(missing.any(axis=1).sum())

    def _telemetry(
        self, topic: str, first: int, end: int, needed: Iterable[str]
    ) -> tuple[tuple[str, ...], Array]:
        """The names of most messages that have the needed ones, and the values (K, n)."""
        names = self._steps.read(topic, lambda message: tuple(message.name))
        common = Counter(found for found in names if set(needed) <= set(found)).most_common(1)
        if not common:
            return (), np.empty((end - first, 0))
        (most, _) = common[0]
        return most, self._steps.named(topic, most, finite=False).values[first:end]

    def _without_an_outcome(self, end: int, lasts: Mapping[str, int]) -> str:
        """Why the run ends here, and which topics go on."""
        sentence = f"the recording has no outcome, it ends after {end} of {self.scenario.steps} steps"
        longer = [f"{name} to step {last}" for name, last in lasts.items() if last > end]
        return f"{sentence}, the last that all topics have ({', '.join(longer)})" if longer else sentence

    def _read_scenario(self, topics: Topics) -> tuple[Scenario, str, int]:
        """The last usable scenario sent before the first state, or else the first; its run's id; unusable ones."""
        topic = topics.get(f"{self._namespace}/scenario")
        if topic is None or not len(topic):
            raise AnalysisError(
                f"{self._path} has no {self._namespace}/scenario, so it is no recording of a run: give"
                " the folder of one"
            )
        found: list[tuple[int, Scenario, str]] = []
        fault = ""
        for sent_ns, message in zip(topic.publish_times_ns, topic.readable, strict=True):
            text = str(getattr(message, "data", ""))  # a damaged message, or one of another type, has none
            try:
                found.append((int(sent_ns), from_yaml(text), run_id_of(text)))
            except OwnClassError as error:
                raise AnalysisError(f"the scenario in {self._path} cannot be used: {error}") from error
            except ParameterError as error:
                fault = fault or str(error)
        if not found:
            raise AnalysisError(
                f"the scenario in {self._path} cannot be used ({fault}): analyse the recording with the version"
                " in its versions.json"
            )
        states = topics.get(f"{self._namespace}/state")
        begins_ns = states.publish_times_ns.min() if states else math.inf
        _, scenario, run_id = next((each for each in reversed(found) if each[0] <= begins_ns), found[0])
        return scenario, run_id, len(topic) - len(found)

    def _read_ending(self) -> dict[str, Any]:
        """The last outcome of this run, empty without one."""

        def read(message: Any) -> dict[str, Any]:
            found = read_outcome(str(message.data))
            if found["outcome"] not in list(Outcome) or found["run_id"] != self.run_id:
                raise MessageError("outcome", f"{found['outcome']} is not an outcome of this run")
            return found

        return next(reversed(self._steps.read("outcome", read)), {})

    def _read_changes(self) -> tuple[ParameterChange, ...]:
        """Parameters changed during the run, in the order of the steps; the later one of two of one step."""
        found = {(change.step, change.node): change for change in self._steps.read("changes", self._change)}
        return tuple(found[key] for key in sorted(found))

    def _change(self, message: Any) -> ParameterChange:
        content = json.loads(str(message.data))
        control = None if content["control"] is None else tuple(map(float, content["control"]))
        change = ParameterChange(
            str(content["node"]), int(content["step"]), dict(content["parameters"]), control
        )
        # Numbers and choices only: the name of a file would be read here.
        fits = change.of_scenario.keys() <= {leaf.name for leaf in leaves(self.scenario)}
        fits &= all(0 <= number <= self.scenario.steps for number in (change.step, change.delay_steps))
        if not fits or (control is not None and len(control) != len(self.plant.control_names)):
            raise MessageError("change", "it is no change of this run")
        override(self.scenario, change.of_scenario)
        return change

    def _refuse_none(self, name: str, rows: Rows) -> None:
        """Raise `AnalysisError` where no message of a topic that every run has can be used."""
        if rows.present.any():
            return
        ended = f", the run ended before: {reason}" if (reason := self._ending.get("reason")) else ""
        left_out = f" ({count} cannot be used)" if (count := self.ignored.get(name)) else ""
        raise AnalysisError(
            f"{self._path} has no message on {self._namespace}/{name}{left_out}{ended}; `skydiver-utc replay` plays the"
            " messages that are there"
        )
