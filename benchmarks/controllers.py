# SPDX-License-Identifier: Apache-2.0
"""The controllers of the package and the C transcription, timed along flights of the fast turn."""

import ctypes
import time
from collections.abc import Callable, Mapping

import numpy as np
from c_transcription import CUtc, address

from skydiver_utc.loop.build import build_controller, build_plant, build_reference
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.loop.run import Run
from skydiver_utc.parameters import Scenario, load_scenario

FAST = "fast_turn_unknown_dynamics"
DURATION_S = 5.0
# Two results of the same arithmetic in another order of additions.
AGREEMENT = 1e-9


def short(name: str, changes: Mapping[str, object] | None = None) -> Scenario:
    """The first seconds of a scenario, with other values under these dotted names."""
    return load_scenario(name, {"duration_s": DURATION_S, **(changes or {})})


def decision(scenario: Scenario) -> Callable[[], float]:
    """One decision of a scenario's controller, along its own flight [s]."""
    flight = simulate(scenario)
    controller = build_controller(scenario, build_plant(scenario), build_reference(scenario))
    steps = len(flight.commands)
    profile = build_reference(scenario).preview(0, steps + controller.preview_steps + 1)
    position = 0

    def once() -> float:
        nonlocal position
        k = position % steps
        if k == 0:
            controller.reset()
        position += 1
        state, preview = flight.states[k], profile[k : k + controller.preview_steps + 1]
        begin = time.process_time()
        controller.decide(state, preview)
        return time.process_time() - begin

    return once


def c_step(loaded: ctypes.CDLL, scenario: Scenario) -> Callable[[], float]:
    """One UTC step in C along the flight of the package's UTC, with Qu made beforehand [s]."""
    flight = simulate(scenario)
    _check(largest_difference(loaded, flight))
    utc, profile, steps = _prepared(loaded, flight)
    addresses = [address(state) for state in flight.states]
    position = 0

    def once() -> float:
        nonlocal position
        k = position % steps
        if k == 0:
            utc.prepare(profile, steps)
        position += 1
        state = addresses[k]
        begin = time.process_time()
        utc.step(k, state)
        return time.process_time() - begin

    return once


def largest_difference(loaded: ctypes.CDLL, flight: Run) -> float:
    """Largest difference of C's controls, predictions and deviations of U from a flight's, over all its steps.

    C sees the states of the flight, and keeps U and Pu of its own from the first step on.
    """
    utc, _, steps = _prepared(loaded, flight)
    names = flight.telemetry_names
    predicted = flight.telemetry[:, names.index("predicted_yaw_rate")]
    first = next(i for i, name in enumerate(names) if name.startswith("std_"))
    largest = 0.0
    for k in range(steps):
        utc.step(k, address(flight.states[k]))
        deviations = np.sqrt(np.maximum(np.diag(utc.covariance), 0.0))
        for ours, theirs in (
            (flight.commands[k], utc.control),
            (predicted[k], utc.predicted),
            (flight.telemetry[k, first : first + 4], deviations),
        ):
            largest = max(largest, float(np.abs(ours - theirs).max()))
    return largest


def _check(difference: float) -> None:
    if not difference <= AGREEMENT:
        raise RuntimeError(
            f"c/utc_step.c differs from the package by {difference:.1e}: its times mean nothing"
        )


def _prepared(loaded: ctypes.CDLL, flight: Run) -> tuple[CUtc, np.ndarray, int]:
    scenario, steps = flight.scenario, len(flight.commands)
    preview_steps = build_controller(scenario, flight.plant, build_reference(scenario)).preview_steps
    profile = build_reference(scenario).preview(0, steps + preview_steps + 1)
    utc = CUtc(loaded, scenario)
    utc.prepare(profile, steps)
    return utc, profile, steps
