# SPDX-License-Identifier: Apache-2.0
"""The lockstep closed loop in one process: the run over ROS must equal it bit for bit."""

import time
from collections.abc import Callable

import numpy as np

from skydiver_utc.controllers.protocol import Controller
from skydiver_utc.loop.outcome import OutcomeMonitor
from skydiver_utc.loop.registry import (
    build_controller,
    build_disturbances,
    build_estimator,
    build_plant,
    build_reference,
)
from skydiver_utc.loop.run import Run
from skydiver_utc.parameters import Scenario
from skydiver_utc.plants.protocol import Plant
from skydiver_utc.references.protocol import Reference

Build = Callable[[Scenario, Plant, Reference], Controller]


def simulate(
    scenario: Scenario, progress: Callable[[int, int], None] | None = None, build: Build = build_controller
) -> Run:
    """Run a scenario; `progress(steps done, steps in all)` is called about fifty times.

    `build` makes the controller, where it is not the scenario's own.
    """
    plant, reference = build_plant(scenario), build_reference(scenario)
    controller, estimator = build(scenario, plant, reference), build_estimator(scenario, plant)
    disturbances = build_disturbances(scenario, plant)
    steps, m, width = scenario.steps, len(plant.control_names), controller.preview_steps + 1
    profile = reference.preview(0, steps + width)
    state = plant.initial_state()
    states = np.empty((steps + 1, len(state)))
    commands, applied = np.empty((steps, m)), np.empty((steps, m))
    telemetry = np.empty((steps, len(controller.telemetry_names)))
    solve_time_s, status = np.empty(steps), np.empty(steps)
    states[0], held = state, plant.initial_applied()
    monitor = OutcomeMonitor(scenario, plant)
    monitor.observe(0, state)

    # Compiled before the clock starts.
    controller.decide(state.copy(), profile[:width].copy())
    controller.reset()
    plant.step(state, held, plant.actuate(held[:m], held))
    start = time.perf_counter()
    flown = steps
    for k in range(steps):
        measured = states[k]
        for disturbance in disturbances:
            measured = disturbance.measurement(k, measured)
        estimate = estimator.update(measured)
        began_ns = time.perf_counter_ns()
        decision = controller.decide(estimate, profile[k : k + width])
        solve_time_s[k] = (time.perf_counter_ns() - began_ns) * 1e-9
        commands[k], telemetry[k], status[k] = decision.control, decision.telemetry, decision.status
        before, held = held, plant.actuate(decision.control, held)
        applied[k] = held[:m]
        estimator.predict(held)
        state = plant.step(states[k], before, held)
        for disturbance in disturbances:
            state = disturbance.state(k + 1, state)
        states[k + 1] = state
        if not monitor.observe(k + 1, state):
            flown = k + 1
            break
        if progress is not None and k % max(1, steps // 50) == 0:
            progress(k, steps)
    wall_time_s = time.perf_counter() - start
    if progress is not None:
        progress(flown, steps)
    return Run(
        scenario=scenario,
        plant=plant,
        states=states[: flown + 1],
        commands=commands[:flown],
        applied=applied[:flown],
        reference=profile[: flown + 1],
        tracked_names=reference.outputs,
        amplitude=reference.amplitude,
        telemetry=telemetry[:flown],
        telemetry_names=controller.telemetry_names,
        solve_time_s=solve_time_s[:flown],
        status=status[:flown],
        outcome=monitor.outcome,
        reason=monitor.reason,
        wall_time_s=wall_time_s,
    )
