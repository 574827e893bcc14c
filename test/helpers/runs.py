# SPDX-License-Identifier: Apache-2.0
"""Synthetic runs whose metrics can be computed by hand."""

from functools import cache
from typing import Any

import numpy as np

from skydiver_utc.loop.build import build_plant, build_reference
from skydiver_utc.loop.outcome import Outcome
from skydiver_utc.loop.run import Run
from skydiver_utc.parameters import Scenario, from_yaml, load_scenario
from skydiver_utc.plants.skydiver.skydiver import SkydiverPlant

EPOCH_S = 1_700_000_000
LIMITS = {"Cm_damp_yaw": [0.0, 4.0], "k_right": [-1.0, 1.0], "k_left": [-1.0, 1.0], "alpha": [-1.0, 1.0]}
CART_PLANT = """\
plant:
  kind: linear
  time: continuous
  A: [[0.0, 1.0], [0.0, -0.1]]
  B: [[0.0], [2.0]]
  states: [place, speed]
  controls: [force]
  initial: [0.0, 0.0]
  minimum: [-3.0]
  maximum: [3.0]
"""
CART = f"""
name: cart
title: A cart on rails
duration_s: 4.0
dt_s: 0.05
epoch_s: 1700000000
{CART_PLANT}reference: {{kind: constant, values: {{place: 2.0, speed: 0.0}}}}
controller: {{kind: open_loop}}
"""


def cart() -> Scenario:
    """A linear plant with the outputs place and speed, both with a reference."""
    return from_yaml(CART)


def skydiver(
    duration_s: float = 4.0, dt_s: float = 0.05, reference: dict[str, Any] | None = None, **settings: Any
) -> Scenario:
    """A skydiver with round limits, at 100 deg/s unless another reference is given."""
    wanted = reference or {"kind": "constant", "values": {"yaw_rate": float(np.deg2rad(100.0))}}
    return load_scenario(
        "bank_recovery",
        {
            "name": "synthetic",
            "title": "Synthetic run",
            "duration_s": duration_s,
            "dt_s": dt_s,
            "epoch_s": EPOCH_S,
            "plant.limits": {**LIMITS, "alpha_rate": 2.0},
            "plant.initial.Cm_damp_yaw": 1.0,
            # A step of 0.05 s bears no more.
            "plant.damping.Cm_damp_roll": 1.0,
            "plant.damping.Cm_damp_pitch": 1.0,
            "reference": wanted,
        }
        | settings,
    )


def rotation() -> dict[str, Any]:
    """Half a turn from 1 s to 3 s."""
    return {
        "kind": "rotation",
        "output": "yaw_rate",
        "angle_deg": 180.0,
        "start_s": 1.0,
        "duration_s": 2.0,
    }


def run_of(
    yaw_rate_deg_s: Any = 100.0,
    reference_deg_s: Any = 100.0,
    scenario: Scenario | None = None,
    steps: int | None = None,
    **fields: Any,
) -> Run:
    """A level run with the given yaw rate and reference (numbers or K + 1 values); of another plant, all zeros."""
    scenario = scenario or skydiver()
    steps = scenario.steps if steps is None else steps
    plant, reference = build_plant(scenario), build_reference(scenario)
    states = np.zeros((steps + 1, len(plant.state_names)))
    wanted = np.zeros((steps + 1, len(reference.outputs)))
    if isinstance(plant, SkydiverPlant):
        states[:, 6] = 1.0
        states[:, 12] = np.deg2rad(yaw_rate_deg_s)
        wanted[:, 0] = np.deg2rad(reference_deg_s)
    controls = np.tile(plant.initial_control(), (steps, 1))
    content = {
        "scenario": scenario,
        "plant": plant,
        "states": states,
        "commands": controls,
        "applied": controls,
        "reference": wanted,
        "tracked_names": reference.outputs,
        "amplitude": reference.amplitude,
        "telemetry": np.zeros((steps, 0)),
        "telemetry_names": (),
        "solve_time_s": np.full(steps, 20e-6),
        "status": np.zeros(steps),
        "outcome": Outcome.COMPLETED,
        "reason": "80 steps flown",
        "wall_time_s": 0.5,
    }
    return Run(**(content | fields))


@cache
def odd_runs() -> dict[str, Run]:
    """Runs that every page and figure must be able to show."""
    points = {"kind": "points", "output": "alpha", "points": [[0.0, 0.0], [1.0, 0.5]]}
    return {
        "no step": run_of(steps=0, outcome=Outcome.NO_COMMAND),
        "huge": run_of(np.full(81, 1e308), 1e308, solve_time_s=np.full(80, 1e308)),
        "three steps": run_of(steps=3, outcome=Outcome.ABORTED),
        "not a number": run_of(np.full(81, np.nan), outcome=Outcome.DIVERGED),
        "no attitude": run_of(states=np.zeros((81, 13))),
        "recorded from 1.5 s on": run_of(scenario=skydiver(reference=rotation())).since(30),
        "open loop": run_of(scenario=skydiver(reference=points)),
        "another plant": run_of(scenario=cart()),
    }


def random_run(scenario: Scenario | None = None, steps: int = 80, **fields: Any) -> Run:
    """A run no two numbers of which are alike; the quaternions have length 1."""
    random = np.random.default_rng(1)
    run = run_of(scenario=scenario, steps=steps)
    m, outputs = len(run.plant.control_names), len(run.tracked_names)
    states = random.normal(size=run.states.shape)
    if run.plant.state_message == "odometry":
        states[:, 3:7] /= np.linalg.norm(states[:, 3:7], axis=1)[:, np.newaxis]
    return run_of(
        scenario=scenario,
        steps=steps,
        states=states,
        reference=random.normal(1.7, 0.1, (steps + 1, outputs)),
        commands=random.normal(size=(steps, m)),
        applied=random.normal(size=(steps, m)),
        telemetry=random.normal(size=(steps, 2)),
        telemetry_names=("innovation", "clipped"),
        solve_time_s=random.uniform(1e-5, 2e-5, steps),
        status=random.integers(0, 4, steps).astype(float),
        **fields,
    )
