# SPDX-License-Identifier: Apache-2.0
"""benchmarks/references.py in short: what fast_turn_beyond_the_paper holds on the athlete."""

from functools import cache

import pytest
from references import BEYOND, Case, Result, cases, fly, holds

from skydiver_utc.parameters import load_scenario


@cache
def by_name() -> dict[str, Case]:
    return {case.name: case for case in cases("athlete")}


@pytest.mark.long
@pytest.mark.parametrize("name", ["300 at 0.3 Hz", "400 at 0.2 Hz"])
def test_one_setting_holds_the_hardest_cases(name: str) -> None:
    case = by_name()[name]
    assert case.is_turn
    assert holds(case, fly(case, BEYOND, "athlete"), Result(0.0, 0.0))


@pytest.mark.long
def test_every_case_is_the_setting_of_the_scenario_and_every_turn_within_reach_is_there() -> None:
    for case in by_name().values():
        assert case.scenario(BEYOND, "athlete").controller == load_scenario(BEYOND).controller
    assert sum(case.is_turn for case in by_name().values()) == 22


def test_a_turn_that_does_not_converge_and_a_reference_that_is_lost_do_not_hold() -> None:
    turn, other = Case("turn", {}, is_turn=True), Case("other", {})
    exact = Result(0.0, 0.0)
    assert [holds(turn, Result(0.9, t), exact) for t in (0.9, 1.1, None)] == [True, False, False]
    assert [holds(other, Result(r, None), Result(2.0, 0.0)) for r in (2.9, 3.1)] == [True, False]
    assert not holds(other, Result(25.0, None), Result(24.0, None))
