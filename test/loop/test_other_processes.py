# SPDX-License-Identifier: Apache-2.0
"""Runs that another process made, as they come here: machine code stays there, everything else comes along."""

import pickle

import numpy as np
import pytest

from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.loop.build import build_plant
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.parameters import load_scenario

SCENARIO = load_scenario("fast_turn_pi_dynamics", {"duration_s": 0.5})


def test_a_run_that_was_sent_is_analysed_as_here() -> None:
    run = simulate(SCENARIO)
    received = pickle.loads(pickle.dumps(run))
    np.testing.assert_array_equal(received.plant.outputs(received.states), run.plant.outputs(run.states))
    assert metrics(received) == metrics(run)


def test_a_plant_that_has_been_used_can_be_sent_and_its_machine_code_cannot() -> None:
    plant = build_plant(SCENARIO)
    state, applied = plant.initial_state(), plant.initial_applied()
    following = plant.step(state, applied, applied)
    received = pickle.loads(pickle.dumps(plant))
    np.testing.assert_array_equal(received.step(state, applied, applied), following)
    with pytest.raises(TypeError):
        pickle.dumps(plant.bound_model)
