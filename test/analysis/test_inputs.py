# SPDX-License-Identifier: Apache-2.0
"""The inputs of recorded flights, estimated from their states."""

import json

import numpy as np
import pytest
from command_line import invoke
from recordings import write_run
from runs import run_of

from skydiver_utc.analysis.inputs import estimate_inputs, report
from skydiver_utc.errors import AnalysisError
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.parameters import load_scenario

pytestmark = pytest.mark.long  # the program that estimates is compiled for ten seconds

DAMPING_AND_HANDS = ("Cm_damp_yaw", "k_right", "k_left")


def inputs_of(name, **changes):
    return report(estimate_inputs(simulate(load_scenario(name, changes))))["inputs"]


@pytest.mark.parametrize("name", ["fast_turn_unknown_dynamics", "fast_turn_gyro_accelerometer"])
def test_the_inputs_of_a_turn_are_found_from_true_states_and_from_estimated_ones(name):
    found = inputs_of(name, duration_s=6.0)
    for control in DAMPING_AND_HANDS:
        assert found[control]["seen_share"] > 0.8
        assert found[control]["rmse"] < 0.06 * 5.0
        assert found[control]["inside_two_deviations"] > 0.9
    assert found["alpha"]["seen_share"] > 0.8
    assert found["alpha"]["rmse"] < 0.2 * 3.0


def test_hands_at_rest_and_damping_without_a_turn_are_not_seen():
    found = inputs_of("bank_recovery", duration_s=3.0)
    for control in DAMPING_AND_HANDS:
        assert found[control]["verdict"] == "not seen"
        assert found[control]["rmse"] is None
        assert set(found[control]["estimate"]) == {None}
    assert found["alpha"]["verdict"] == "seen"
    assert found["alpha"]["rmse"] < 0.1


def test_a_run_that_is_too_short_is_refused():
    with pytest.raises(AnalysisError, match="longer"):
        estimate_inputs(run_of(100.0).until(2))


def test_the_command_writes_figure_and_numbers_beside_the_bag(tmp_path):
    run = simulate(load_scenario("slow_turn_pose_only", {"duration_s": 1.0}))
    folder = write_run(tmp_path / "run", run)
    result = invoke("inputs", folder, "--json")
    assert result.exit_code == 0, result.output
    values = json.loads(result.output)
    assert values == json.loads((folder / "inputs.json").read_text())
    assert np.isfinite(values["inputs"]["alpha"]["deviation"]).all()
    assert (folder / "inputs.png").stat().st_size > 0
