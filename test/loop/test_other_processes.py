# SPDX-License-Identifier: Apache-2.0
"""Runs that another process made: machine code stays there, everything else comes along."""

import multiprocessing
import pickle
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest

from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.loop.build import build_plant
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.parameters import load_scenario

SCENARIO = load_scenario("fast_turn_pi_dynamics", {"duration_s": 0.5})


@pytest.mark.long
def test_a_run_of_another_process_is_analysed_here() -> None:
    here = simulate(SCENARIO)
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        there = pool.submit(simulate, SCENARIO).result()
    np.testing.assert_array_equal(there.states, here.states)
    np.testing.assert_array_equal(there.plant.outputs(there.states), here.plant.outputs(here.states))
    found, expected = metrics(there), metrics(here)
    assert {name for name in expected if found[name] != expected[name]} <= {"wall_time_s", "solve_time_us"}


def test_a_plant_that_has_been_used_can_be_sent_and_its_machine_code_cannot() -> None:
    plant = build_plant(SCENARIO)
    state, applied = plant.initial_state(), plant.initial_applied()
    following = plant.step(state, applied, applied)
    received = pickle.loads(pickle.dumps(plant))
    np.testing.assert_array_equal(received.step(state, applied, applied), following)
    with pytest.raises(TypeError):
        pickle.dumps(plant.bound_model)
