# SPDX-License-Identifier: Apache-2.0
"""Real time without ROS and without a clock: the account of every step, and its pace."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skydiver_utc.loop.real_time import CommandAccount, RealTimePace

NEUTRAL = {"neutral": np.array([8.0, 0.0]), "after_steps": 5, "ramp_steps": 4}
DT_NS = 4_200_000


def command(k: int) -> np.ndarray:
    return np.array([1.0, 0.001 * k])


def flown(steps: int, arrivals: dict[int, list[int]]) -> tuple[CommandAccount, list[np.ndarray]]:
    """Commands `arrivals[k]` come before step k is chosen."""
    account = CommandAccount(steps, **NEUTRAL)
    chosen = []
    for k in range(steps):
        for answers in arrivals.get(k, []):
            account.receive(answers, command(answers))
        chosen.append(account.choose().copy())
    return account, chosen


def test_late_stale_lost_and_repeated_are_told_apart() -> None:
    #                         in time        2 is late       5 comes before 4: stale; 6 is lost
    account, chosen = flown(10, {0: [0], 2: [1, 1], 4: [2, 3], 6: [5], 7: [4], 9: [8]})
    assert [round(c[1] * 1000) for c in chosen] == [0, 0, 1, 1, 3, 3, 5, 5, 5, 8]
    # step 5 wanted 4 (stale), step 7 wanted 6 and step 8 wanted 7 (lost), step 3 wanted 2 (late)
    assert account.as_dict() == {
        "steps": 10, "on_time": 6, "late": 1, "stale": 1, "lost": 2, "repeated": 1,
        "neutral_steps": 0, "longest_silence_steps": 2,
    }  # fmt: skip


@given(st.lists(st.lists(st.integers(0, 39), max_size=4), min_size=40, max_size=40))
def test_every_step_is_accounted_for_once(arrivals: list[list[int]]) -> None:
    """Whatever comes in whatever order, of states that were published."""
    account = CommandAccount(40, **NEUTRAL)
    on_time = 0
    seen: set[int] = {0}
    account.receive(0, command(0))
    for k in range(40):
        for answers in arrivals[k]:
            if answers < k:
                account.receive(answers, command(answers))
                seen.add(answers)
        on_time += k == 0 or k - 1 in seen
        chosen = account.choose()
        assert account.newest == max(seen)
        if not account.in_neutral:
            assert chosen[1] == command(account.newest)[1]
    found = account.as_dict()
    assert found["on_time"] == on_time
    assert found["lost"] == 39 - len(seen - {39})
    assert found["on_time"] + found["late"] + found["stale"] + found["lost"] == found["steps"] == 40
    assert min(found.values()) >= 0


def test_without_commands_it_goes_to_neutral_in_a_straight_line_and_a_new_command_is_taken_at_once() -> None:
    account = CommandAccount(40, **NEUTRAL)
    account.receive(0, np.array([4.0, 1.0]))
    chosen = [account.choose().copy() for _ in range(12)]
    # steps 1 .. 6 hold command 0 (silence 0 .. 5), from step 7 on the ramp goes on
    assert [c.tolist() for c in chosen[:7]] == [[4.0, 1.0]] * 7
    assert [c.tolist() for c in chosen[7:]] == [[5.0, 0.75], [6.0, 0.5], [7.0, 0.25], [8.0, 0.0], [8.0, 0.0]]
    assert account.neutral_steps == 5
    account.receive(11, command(11))
    assert account.choose().tolist() == command(11).tolist()
    assert not account.in_neutral


def paced(ticks_ns: list[int], steps: int = 100) -> tuple[RealTimePace, list[int]]:
    """Tick at these times after the first command; the clock reading of each step [ns]."""
    now_ns, taken_at_ns = 10**9, []

    def step(_: np.ndarray) -> bool:
        taken_at_ns.append(now_ns - 10**9)
        return len(taken_at_ns) < steps

    pace = RealTimePace(CommandAccount(steps, **NEUTRAL), DT_NS, step, lambda: now_ns)
    pace.tick()
    assert not pace.begun
    pace.account.receive(0, command(0))
    for tick_ns in ticks_ns:
        now_ns = 10**9 + tick_ns
        pace.tick()
    return pace, taken_at_ns


def test_steps_keep_the_time_of_the_clock_whatever_the_timer_does() -> None:
    ticks = [0, *np.cumsum(np.tile([DT_NS // 3, DT_NS, 2 * DT_NS], 30)).tolist()]
    pace, taken_at_ns = paced(ticks)
    assert pace.begun
    assert len(taken_at_ns) == ticks[-1] // DT_NS
    for k, at_ns in enumerate(taken_at_ns, start=1):
        assert k * DT_NS <= at_ns < (k + 3) * DT_NS
    assert all(after >= before for before, after in pairwise(taken_at_ns))


def test_a_plant_that_was_held_up_catches_up_and_counts_what_was_late() -> None:
    pace, taken_at_ns = paced([0, DT_NS, 10 * DT_NS + 1])
    assert len(taken_at_ns) == 10
    assert pace.late_steps == 8  # the steps 2 to 9; step 10 is in time
    assert pace.as_dict()["lateness_ms_max"] == pytest.approx(8 * 4.2, rel=1e-3)
