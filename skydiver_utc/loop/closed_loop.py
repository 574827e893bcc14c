# SPDX-License-Identifier: Apache-2.0
"""The lockstep closed loop in one process: the run over ROS must equal it bit for bit."""

import time
from collections.abc import Callable

import numpy as np

from skydiver_utc.controllers.protocol import Controller
from skydiver_utc.loop.build import build_controller, build_estimator, build_reference, model_beside
from skydiver_utc.loop.decisions import Decider
from skydiver_utc.loop.plant_steps import PlantSteps
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
    plant_steps, reference = PlantSteps(scenario), build_reference(scenario)
    plant = plant_steps.plant
    model = model_beside(plant, scenario)
    controller, estimator = build(scenario, model, reference), build_estimator(scenario, model)
    decider = Decider(controller, estimator, model, plant_steps.disturbance)
    steps, m, width = scenario.steps, len(plant.control_names), controller.preview_steps + 1
    profile = np.ascontiguousarray(reference.preview(0, steps + width), dtype=float)
    states = np.empty((steps + 1, len(plant_steps.state)))
    commands, applied = np.empty((steps, m)), np.empty((steps, len(plant_steps.applied)))
    telemetry = np.empty((steps, len(decider.telemetry_names)))
    solve_time_s, status = np.empty(steps), np.empty(steps)
    disturbance = plant_steps.disturbance
    acted = np.empty((steps + 1, len(disturbance.names)))
    states[0] = plant_steps.state

    # Compiled before the clock starts.
    controller.decide(states[0].copy(), profile[:width].copy())
    decider.begin()
    plant_steps.begin()
    start = time.perf_counter()
    flown = steps
    for k in range(steps):
        decision = decider.decide(k, plant_steps.measured, profile[k : k + width])
        solve_time_s[k] = decider.solve_time_s
        commands[k], telemetry[k], status[k] = decision.control, decision.telemetry, decision.status
        if disturbance.names:
            acted[k] = disturbance.acted(k, states[k])
        goes_on = plant_steps.step(decision.control)
        applied[k] = plant_steps.applied
        decider.predict()
        states[k + 1] = plant_steps.state
        if not goes_on:
            flown = k + 1
            break
        if progress is not None and k % max(1, steps // 50) == 0:
            progress(k, steps)
    acted[flown] = disturbance.acted(flown, states[flown])
    wall_time_s = time.perf_counter() - start
    if progress is not None:
        progress(flown, steps)
    return Run(
        scenario=scenario,
        plant=plant,
        states=states[: flown + 1],
        commands=commands[:flown],
        applied=applied[:flown, :m],
        reference=profile[: flown + 1],
        tracked_names=reference.outputs,
        amplitude=reference.amplitude,
        telemetry=telemetry[:flown],
        telemetry_names=decider.telemetry_names,
        solve_time_s=solve_time_s[:flown],
        status=status[:flown],
        outcome=plant_steps.outcome,
        reason=plant_steps.reason,
        wall_time_s=wall_time_s,
        disturbance=acted[: flown + 1],
        disturbance_names=disturbance.names,
    )
