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
from skydiver_utc.simulation.build import build_controller, build_reference
from skydiver_utc.simulation.flight import Flight

SCHEMA_VERSION = 1
_CONTROLLER = "controller"

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Check:
    """The recorded flight and the answers of the controller that was asked, commands (K, 4).

    `reference_added` counts the steps of the reference that no recorded preview covers, at the end of the flight:
    there the recorded scenario's own reference stands in. In real time a step without an answer has the command
    that was held, and the recorded controller saw the newest states only: equal bits are not to be had.
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
        """Step and control of the first difference, None without any."""
        places = np.argwhere(self.differs)
        return (int(places[0, 0]), int(places[0, 1])) if len(places) else None


def check(recording: RecordedFlight, instead: Callable[[Scenario], Scenario] = lambda s: s) -> Check:
    """Ask the recorded scenario's controller, or that of the scenario which `instead` makes of it.

    The states are those of the recorded flight, whatever the answers: another controller is asked what it would
    have done at each of them, it does not fly. Its memory, from the first step on, is its own; where the recorded
    controller began anew in flight, with other parameters or as another process, so does the one that is asked.
    """
    flight = recording.flight()
    if len(flight.commands) == 0:
        raise AnalysisError(
            "the recording has no whole step, so there is nothing to check: record the flight again"
        )
    stretches = _stretches(flight, instead)
    ahead = max(stretch.controller.preview_steps for stretch in stretches)
    reference, added = _reference(recording, flight, ahead)
    commands = decide_again(stretches, flight.states, reference)
    return Check(flight, commands, added, recording.in_real_time())


def _stretches(flight: Flight, instead: Callable[[Scenario], Scenario]) -> list[Stretch]:
    """The controllers of the flight, from the first step of each on."""
    changes = [change for change in flight.changes if change.node == _CONTROLLER]
    begins = {0: Stretch(0, build_controller(instead(flight.scenario)), None)}
    for change in changes:
        if change.step < len(flight.commands):
            controller = build_controller(instead(override(flight.scenario, change.parameters)))
            control = None if change.control is None else np.array(change.control)
            begins[change.step] = Stretch(change.step, controller, control)
    return list(begins.values())


def report(found: Check) -> dict[str, Any]:
    """The result as plain data, in the order in which it is printed."""
    dt_s = found.flight.scenario.dt_s
    error = found.commands - found.flight.commands
    first = found.first_difference
    return {
        "schema_version": SCHEMA_VERSION,
        "scenario": found.flight.scenario.name,
        "in_real_time": found.in_real_time,
        "equal": found.equal,
        "steps": len(error),
        "different_steps": int(found.differs.any(axis=1).sum()),
        "first_difference": first
        and {
            "step": first[0],
            "time_s": first[0] * dt_s,
            "control": CONTROL_NAMES[first[1]],
            "recorded": float(found.flight.commands[first]),
            "answer": float(found.commands[first]),
        },
        "controls": {
            name: {
                "rms": float(np.sqrt(np.mean(np.square(error[:, j])))),
                "largest": float(np.max(np.abs(error[:, j]))),
                "largest_at_s": int(np.argmax(np.abs(error[:, j]))) * dt_s,
            }
            for j, name in enumerate(CONTROL_NAMES)
        },
        "reference_steps_not_recorded": found.reference_added,
    }


def _reference(recording: RecordedFlight, flight: Flight, ahead: int) -> tuple[Floats, int]:
    """Reference (K + ahead,): previews, then setpoints, then the scenario's own; and how many of the last."""
    values = recording.previews(len(flight.commands) + ahead)
    known = min(len(values), len(flight.reference))
    values[:known] = np.where(np.isnan(values[:known]), flight.reference[:known], values[:known])
    missing = np.isnan(values)
    if missing.any():
        values[missing] = build_reference(flight.scenario).preview(0, len(values))[missing]
    return values, int(missing.sum())
