# SPDX-License-Identifier: Apache-2.0
"""The texts of a run: scenario, changes, outcome."""

import json

import pytest

from skydiver_utc.messages import (
    MessageError,
    outcome_text,
    read_outcome,
    run_id_of,
    scenario_text,
)
from skydiver_utc.parameters import from_yaml, load_scenario, to_yaml


def test_a_scenario_carries_the_id_of_its_run_and_is_read_as_before() -> None:
    scenario = load_scenario("fast_turn_unknown_dynamics")
    text = scenario_text(to_yaml(scenario), "abc123")
    assert run_id_of(text) == "abc123"
    assert from_yaml(text) == scenario
    assert run_id_of(to_yaml(scenario)) == ""


def test_an_outcome_comes_back_with_what_was_added() -> None:
    text = outcome_text("abc123", "completed", "5 steps", wall_time_s=0.5, states=6, real_time={"late": 2})
    found = read_outcome(text)
    assert (found["run_id"], found["outcome"], found["states"]) == ("abc123", "completed", 6)
    assert found["real_time"] == {"late": 2}
    without = {name: value for name, value in json.loads(text).items() if name != "run_id"}
    assert read_outcome(json.dumps(without))["run_id"] == ""


@pytest.mark.parametrize(
    "text",
    [
        *("", "null", "[]", "{}", '{"outcome": "completed"}', "[" * 100_000),
        outcome_text("", "completed", "", wall_time_s="x", states=6),
        outcome_text("", "c", "", wall_time_s=1, states=-1),
    ],
)
def test_a_text_that_is_no_outcome_is_refused(text: str) -> None:
    with pytest.raises(MessageError) as refused:
        read_outcome(text)
    assert refused.value.kind == "outcome"
