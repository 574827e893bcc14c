# SPDX-License-Identifier: Apache-2.0
"""A plant's side of the loop: pushes and resets of its state."""

from pathlib import Path
from typing import Any

import numpy as np
from own_slots import cart_file

from skydiver_utc.disturbances.composed import Composed
from skydiver_utc.loop.plant_steps import PlantSteps
from skydiver_utc.parameters import load_scenario
from skydiver_utc.plants.skydiver.skydiver import SkydiverPlant


def test_a_reset_forgets_the_pushes_before_it_and_takes_those_after_it(tmp_path: Path) -> None:
    run = PlantSteps(load_scenario(cart_file(tmp_path)))
    command, push, initial = np.array([1.0, 0.0]), np.array([0.0, 7.0]), run.plant.initial_state()
    run.begin()
    run.step(command)
    assert run.pushed is None
    before = run.state
    run.push(push)
    run.reset_state()
    run.step(command)
    np.testing.assert_allclose(run.state, initial, atol=1e-15)
    np.testing.assert_array_equal(run.state, run.plant.step(before, run.applied, run.applied) + run.pushed)
    run.reset_state()
    run.push(push)
    run.step(command)
    np.testing.assert_allclose(run.state, initial + push, atol=1e-15)
    run.step(command)
    assert run.pushed is None


def test_a_disturbance_need_not_inherit() -> None:
    methods = {
        "wind": lambda self, k: np.array([0.0, 0.0, 2.0]),
        "state": lambda self, k, state: state,
        "measurement": lambda self, k, state: state,
        "reset": lambda self: None,
    }
    breeze: Any = type("Breeze", (), methods)()
    scenario = load_scenario("fast_turn_lqr")
    plant = SkydiverPlant(scenario.plant, scenario.dt_s)
    np.testing.assert_array_equal(Composed([breeze], plant, scenario.dt_s).wind(3), [0.0, 0.0, 2.0])
