"""The lockstep closed loop in one process: the reference path that the ROS run must equal bit for bit."""

import time
from collections.abc import Callable

import numpy as np

from skydiver_utc.control.protocol import Controller
from skydiver_utc.parameters import Scenario
from skydiver_utc.simulation.build import build_controller, build_plant, build_reference
from skydiver_utc.simulation.flight import Flight
from skydiver_utc.simulation.outcome import OutcomeMonitor


def simulate(
    scenario: Scenario,
    progress: Callable[[int, int], None] | None = None,
    build: Callable[[Scenario], Controller] = build_controller,
) -> Flight:
    """Fly a scenario; `progress` is told (steps done, steps in all) about fifty times.

    `build` makes the controller, where it is not the scenario's own.
    """
    plant, reference, controller = build_plant(scenario), build_reference(scenario), build(scenario)
    steps = scenario.steps
    profile = reference.preview(0, steps + controller.preview_steps + 1)
    states = np.empty((steps + 1, 13))
    commands, applied = np.empty((steps, 4)), np.empty((steps, 4))
    telemetry = np.empty((steps, len(controller.telemetry_names)))
    solve_time_s, status = np.empty(steps), np.empty(steps)
    states[0], held = plant.initial_state(), plant.initial_applied()
    monitor = OutcomeMonitor(scenario)
    monitor.observe(0, states[0])

    _compile(scenario, build)
    start = time.perf_counter()
    flown = steps
    for k in range(steps):
        asked = time.perf_counter_ns()
        decision = controller.decide(states[k], profile[k : k + controller.preview_steps + 1])
        solve_time_s[k] = (time.perf_counter_ns() - asked) * 1e-9
        commands[k], telemetry[k], status[k] = decision.control, decision.telemetry, decision.status
        before, held = held, plant.actuate(decision.control, held)
        applied[k] = held[:4]
        states[k + 1] = plant.step(states[k], before, held)
        if not monitor.observe(k + 1, states[k + 1]):
            flown = k + 1
            break
        if progress is not None and k % max(1, steps // 50) == 0:
            progress(k, steps)
    wall_time_s = time.perf_counter() - start
    if progress is not None:
        progress(flown, steps)
    return Flight(
        scenario=scenario,
        states=states[: flown + 1],
        commands=commands[:flown],
        applied=applied[:flown],
        reference=profile[: flown + 1],
        telemetry=telemetry[:flown],
        telemetry_names=controller.telemetry_names,
        solve_time_s=solve_time_s[:flown],
        status=status[:flown],
        outcome=monitor.outcome,
        reason=monitor.reason,
        wall_time_s=wall_time_s,
    )


def _compile(scenario: Scenario, build: Callable[[Scenario], Controller]) -> None:
    """Call every kernel of the loop once, on parts that are thrown away, so that no clock counts compilation."""
    plant, controller = build_plant(scenario), build(scenario)
    state, held = plant.initial_state(), plant.initial_applied()
    controller.decide(state, build_reference(scenario).preview(0, controller.preview_steps + 1))
    plant.step(state, held, plant.actuate(held[:4], held))
