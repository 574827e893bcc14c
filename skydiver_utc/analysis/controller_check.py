"""A controller asked again: the states and the reference of a recording, and what it answers to them now."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.analysis.errors import AnalysisError
from skydiver_utc.analysis.recorded_flight import CONTROL_NAMES, RecordedFlight
from skydiver_utc.parameters import Scenario, override
from skydiver_utc.simulation.asked_again import Stretch, decide_again
from skydiver_utc.simulation.build import build_controller
from skydiver_utc.simulation.flight import Flight, ParameterChange

SCHEMA_VERSION = 1
_CONTROLLER = "controller"

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Check:
    """The recorded flight, as far as it was checked, and the answers of the controller asked, commands (K, 4).

    `reference_added` counts the steps of the reference that no recorded message tells, at the end of the flight or
    where its node was dead: there the recorded scenario's own reference stands in. In real time a step without an
    answer has the command that was held, and the recorded controller saw the newest states only: equal bits are not
    to be had.
    """

    flight: Flight
    commands: Floats
    reference_added: int
    in_real_time: bool

    @property
    def differs(self) -> NDArray[np.bool_]:
        """Where recorded command and answer are not the same bits, (K, 4)."""
        recorded = np.ascontiguousarray(self.flight.commands).view(np.int64)
        differs: NDArray[np.bool_] = recorded != np.ascontiguousarray(self.commands).view(np.int64)
        return differs

    @property
    def equal(self) -> bool:
        """True when every command is the recorded one, bit for bit."""
        return not self.differs.any()

    @property
    def first_difference(self) -> tuple[int, int] | None:
        """Row and control of the first difference, None without any."""
        places = np.argwhere(self.differs)
        return (int(places[0, 0]), int(places[0, 1])) if len(places) else None


def check(recording: RecordedFlight, instead: Callable[[Scenario], Scenario] = lambda s: s) -> Check:
    """Ask the recorded scenario's controller, or that of the scenario which `instead` makes of it.

    The states are those of the recorded flight, whatever the answers: another controller is asked what it would
    have done at each of them, it does not fly. Its memory, from the first step on, is its own; where the recorded
    controller began anew in flight, with other parameters or as another process, so does the one that is asked.

    A recording that lacks the beginning of the flight is checked from where the recorded controller began anew,
    the first place where its memory is known; `AnalysisError` where it never did.
    """
    flight = _with_known_memory(recording.flight())
    if len(flight.commands) == 0:
        raise AnalysisError(
            "the recording has no whole step, so there is nothing to check: record the flight again"
        )
    stretches = _stretches(flight, instead)
    ahead = max(stretch.controller.preview_steps for stretch in stretches)
    reference, added = _reference(recording, flight, ahead)
    commands = decide_again(stretches, flight.states, reference)
    return Check(flight, commands, added, recording.in_real_time())


def _with_known_memory(flight: Flight) -> Flight:
    """From the first step on at which the controller's memory is known: step 0, or where it began anew."""
    if flight.first_step == 0:
        return flight
    begins = [change.step for change in _beginnings(flight)]
    if not begins:
        raise AnalysisError(
            f"the recording begins at step {flight.first_step}, and what the controller remembered there is not"
            " known, so its answers cannot be checked: give a recording from step 0 on, or one in which the"
            " controller began anew"
        )
    return flight.since(begins[0])


def _beginnings(flight: Flight) -> list[ParameterChange]:
    """Where the recorded controller began, with other parameters or anew, in the order of the steps."""
    end = flight.first_step + len(flight.commands)
    return [
        change
        for change in flight.changes
        if change.node == _CONTROLLER and flight.first_step <= change.step < end
    ]


def _stretches(flight: Flight, instead: Callable[[Scenario], Scenario]) -> list[Stretch]:
    """The controllers of the flight, from the first row of each on."""
    begins = {}
    if flight.first_step == 0:
        begins[0] = Stretch(0, build_controller(instead(flight.scenario)), None)
    for change in _beginnings(flight):
        scenario = instead(override(flight.scenario, change.of_scenario))
        controller = build_controller(scenario, change.delay_steps)
        control = None if change.control is None else np.array(change.control)
        row = change.step - flight.first_step
        begins[row] = Stretch(row, controller, control)
    return list(begins.values())


def report(found: Check) -> dict[str, Any]:
    """The result as plain data, in the order in which it is printed."""
    time_s = found.flight.time_s
    error = found.commands - found.flight.commands
    first = found.first_difference
    return {
        "schema_version": SCHEMA_VERSION,
        "scenario": found.flight.scenario.name,
        "in_real_time": found.in_real_time,
        "equal": found.equal,
        "first_step": found.flight.first_step,
        "steps": len(error),
        "different_steps": int(found.differs.any(axis=1).sum()),
        "first_difference": first
        and {
            "step": found.flight.first_step + first[0],
            "time_s": float(time_s[first[0]]),
            "control": CONTROL_NAMES[first[1]],
            "recorded": float(found.flight.commands[first]),
            "answer": float(found.commands[first]),
        },
        "controls": {
            name: {
                "rms": float(np.sqrt(np.mean(np.square(error[:, j])))),
                "largest": float(np.max(np.abs(error[:, j]))),
                "largest_at_s": float(time_s[np.argmax(np.abs(error[:, j]))]),
            }
            for j, name in enumerate(CONTROL_NAMES)
        },
        "reference_steps_not_recorded": found.reference_added,
    }


def _reference(recording: RecordedFlight, flight: Flight, ahead: int) -> tuple[Floats, int]:
    """Reference (K + ahead,): previews, then setpoints, then the scenario's own; and how many of the last."""
    first, count = flight.first_step, len(flight.commands) + ahead
    values = recording.previews(first + count)[first:]
    told = recording.told_reference()[first : first + count]
    values[: len(told)] = np.where(np.isnan(values[: len(told)]), told, values[: len(told)])
    missing = np.isnan(values)
    if missing.any():
        values[missing] = recording.own_reference(first, count)[missing]
    return values, int(missing.sum())
