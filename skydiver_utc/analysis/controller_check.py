# SPDX-License-Identifier: Apache-2.0
"""Compares recorded commands and estimates with those computed from the recorded inputs."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from skydiver_utc.analysis.recorded_run import RecordedRun
from skydiver_utc.arrays import Array, Flags
from skydiver_utc.errors import AnalysisError
from skydiver_utc.estimators.true_state import TrueState
from skydiver_utc.loop.build import (
    build_controller,
    build_disturbances,
    build_estimator,
    build_plant,
    model_beside,
)
from skydiver_utc.loop.decisions import Decider, Stretch, decide_at
from skydiver_utc.loop.estimation import Estimation, estimate_at
from skydiver_utc.loop.run import ParameterChange, Run
from skydiver_utc.parameters import Scenario, override
from skydiver_utc.plants.protocol import Plant

SCHEMA_VERSION = 3
_CONTROLLER, _ESTIMATOR = "controller", "estimator"


@dataclass(frozen=True, eq=False)
class Check:
    """The recorded run, as far as it was checked, and the commands computed at its states or estimates (K, m).

    `reference_added` counts the steps of the reference that are not recorded, at the end of the run or where
    its node was dead: there the recorded scenario's own values are used. In real time a step without a command
    has the one that was held, and the recorded controller received the newest states only: the bits are not
    equal then.
    """

    run: Run
    commands: Array
    reference_added: int
    in_real_time: bool
    reference_revised: int = 0  # steps that a live reference gave other values later on: those are used
    different_estimates: int = 0  # steps whose computed estimate has not the bits of the recorded one
    hole_at_step: int | None = None  # where the recording lacks steps: what follows is not checked

    @property
    def differs(self) -> Flags:
        """True for recorded and computed commands that are not the same bits, (K, m)."""
        return _differing(self.run.commands, self.commands)

    @property
    def equal(self) -> bool:
        """True when every command and every estimate is the recorded one, bit for bit."""
        return not (self.differs.any() or self.different_estimates)


def _differing(recorded: Array, computed: Array) -> Flags:
    """True where the bits are not the same."""
    return np.ascontiguousarray(recorded).view(np.int64) != np.ascontiguousarray(computed).view(np.int64)


def check(recording: RecordedRun, instead: Callable[[Scenario], Scenario] = lambda s: s) -> Check:
    """The commands of the recorded scenario's controller, or of that of the scenario which `instead` makes of it.

    The states, or the estimates, are the recorded ones, whatever the commands: another controller does not fly here.
    Its memory is its own from the first step on; where the recorded controller was restarted or got other parameters,
    so does this one. A recording that lacks steps within is checked up to there, one that lacks the beginning from
    the controller's first restart on, where its memory is known; `AnalysisError` without one. The estimates are
    computed at the recorded measurements and commands.
    """
    run = _with_known_memory(recording.run())
    hole_at_step = run.holes[0][0] if run.holes else None
    if hole_at_step is not None:
        run = run.until(hole_at_step)
    if len(run.commands) == 0:
        raise AnalysisError(
            "the recording has no whole step, so there is nothing to check: record the run again"
        )
    stretches = _stretches(recording, run, instead)
    ahead = max(stretch.decider.controller.preview_steps for stretch in stretches)
    reference, added = _reference(recording, run, ahead)
    controls = len(run.plant.control_names)
    given = recording.estimates(run) if run.scenario.has_estimator else run.states[:-1]
    commands = decide_at(stretches, run.first_step, given, controls, reference)
    revised, different = recording.reference_revised, _different_estimates(recording, run, instead)
    return Check(run, commands, added, recording.in_real_time, revised, different, hole_at_step)


def _begins(run: Run, node: str) -> dict[int, ParameterChange | None]:
    """Rows at which a node began: at the start of a run (None), and at each restart or change of parameters."""
    found: dict[int, ParameterChange | None] = {0: None} if run.first_step == 0 else {}
    rows = ((change.step - run.first_step, change) for change in run.changes if change.node == node)
    return found | {row: change for row, change in rows if 0 <= row < len(run.commands)}


def _scenario_of(run: Run, change: ParameterChange | None) -> Scenario:
    return run.scenario if change is None else override(run.scenario, change.of_scenario)


def _with_known_memory(run: Run) -> Run:
    begins = _begins(run, _CONTROLLER)
    if not begins:
        raise AnalysisError(
            f"the recording begins at step {run.first_step}, where the controller's memory is not known: give a"
            " recording from step 0 on, or one with a restart of the controller"
        )
    return run.since(run.first_step + min(begins)) if run.first_step else run


def _different_estimates(recording: RecordedRun, run: Run, instead: Callable[[Scenario], Scenario]) -> int:
    """Steps with another estimate than the recorded one; from its start on, or else its first restart."""
    begins = _begins(run, _ESTIMATOR)
    if not (run.scenario.has_estimator and begins):
        return 0
    first, estimations = min(begins), {}
    for row, change in begins.items():
        scenario = instead(_scenario_of(run, change))
        plant, disturbance = _model(recording, scenario), build_disturbances(scenario, recording.plant)
        estimations[row - first] = Estimation(build_estimator(scenario, plant), plant, disturbance)
    measured, commands = recording.measured(run)[first:], run.commands[first:]
    computed = estimate_at(estimations, run.first_step + first, measured, commands)
    return int(_differing(recording.estimates(run)[first:], computed).any(axis=1).sum())


def _stretches(recording: RecordedRun, run: Run, instead: Callable[[Scenario], Scenario]) -> list[Stretch]:
    """The controllers of the run, from the first row of each on."""
    found = []
    for row, change in _begins(run, _CONTROLLER).items():
        given = _scenario_of(run, change)
        scenario = instead(given)
        plant, delay_steps = _model(recording, scenario), change.delay_steps if change else 0
        controller = build_controller(scenario, plant, recording.reference, delay_steps)
        disturbance = None if run.scenario.has_estimator else build_disturbances(given, recording.plant)
        control = None if change is None or change.control is None else np.array(change.control)
        found.append(Stretch(row, Decider(controller, TrueState(), plant, disturbance), control))
    return found


def _model(recording: RecordedRun, scenario: Scenario) -> Plant:
    """The plant with which a scenario's controller and estimator predict, which may differ from the recorded one."""
    if scenario.plant == recording.scenario.plant:
        return model_beside(recording.plant, recording.scenario)
    return build_plant(scenario)


def _reference(recording: RecordedRun, run: Run, ahead: int) -> tuple[Array, int]:
    """Reference (K + ahead, l): previews, then setpoints, then the scenario's own; and how many of the last."""
    first, count = run.first_step, len(run.commands) + ahead
    values = recording.previews(first + count)[first:]
    setpoints = recording.setpoints()[first : first + count]
    values[: len(setpoints)] = np.where(
        np.isnan(values[: len(setpoints)]), setpoints, values[: len(setpoints)]
    )
    return recording.filled(values, first)


def report(found: Check) -> dict[str, Any]:
    """The result as plain data, in the order in which it is printed."""
    run, time_s, names = found.run, found.run.time_s, found.run.plant.control_names
    # Row and control.
    first = next(((int(row), int(j)) for row, j in np.argwhere(found.differs)), None)
    error = found.commands - run.commands
    return {
        "schema_version": SCHEMA_VERSION,
        "scenario": run.scenario.name,
        "in_real_time": found.in_real_time,
        "equal": found.equal,
        "first_step": run.first_step,
        "steps": len(error),
        "hole_at_step": found.hole_at_step,
        "different_steps": int(found.differs.any(axis=1).sum()),
        "first_difference": first
        and {
            "step": run.first_step + first[0],
            "time_s": float(time_s[first[0]]),
            "control": names[first[1]],
            "recorded": float(run.commands[first]),
            "computed": float(found.commands[first]),
        },
        "controls": {
            name: {
                "rms": float(np.sqrt(np.mean(np.square(error[:, j])))),
                "largest": float(np.max(np.abs(error[:, j]))),
                "largest_at_s": float(time_s[np.argmax(np.abs(error[:, j]))]),
            }
            for j, name in enumerate(names)
        },
        "different_estimates": found.different_estimates,
        "reference_steps_not_recorded": found.reference_added,
        "reference_steps_revised": found.reference_revised,
    }
