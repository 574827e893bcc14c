"""The account of a real-time flight's steps, and its pace, without ROS and without a clock."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skydiver_utc.nodes.command_accounts import CommandAccounts, NeutralRamp
from skydiver_utc.nodes.real_time_pace import Answer, RealTimePace
from skydiver_utc.parameters import load_scenario

INITIAL = np.array([8.0, 0.5, 0.5, 1.0])
RAMP = NeutralRamp(after_steps=5, rate=0.3, control=np.array([8.0, 0.0, 0.0, 0.0]))


def command(k: int) -> np.ndarray:
    return np.array([1.0, 0.0, 0.0, 0.001 * k])


def flown(steps: int, arrivals: dict[int, list[int]]) -> tuple[CommandAccounts, list[np.ndarray]]:
    """Commands `arrivals[k]` come before step k is chosen."""
    accounts = CommandAccounts(steps, INITIAL, RAMP)
    chosen = []
    for k in range(steps):
        for answers in arrivals.get(k, []):
            accounts.receive(answers, command(answers))
        chosen.append(accounts.choose().copy())
    return accounts, chosen


def test_with_every_command_in_time_each_step_has_that_of_the_state_before() -> None:
    accounts, chosen = flown(6, {0: [0]} | {k: [k - 1] for k in range(2, 6)})
    assert [round(c[3] * 1000) for c in chosen] == [0, 0, 1, 2, 3, 4]
    told = accounts.told()
    assert (told["steps"], told["on_time"], told["longest_silence_steps"]) == (6, 6, 0)


def test_late_stale_lost_and_repeated_are_told_apart() -> None:
    #                         in time        2 is late       5 comes before 4: stale; 6 is lost
    accounts, chosen = flown(10, {0: [0], 2: [1, 1], 4: [2, 3], 6: [5], 7: [4], 9: [8]})
    assert [round(c[3] * 1000) for c in chosen] == [0, 0, 1, 1, 3, 3, 5, 5, 5, 8]
    # step 5 wanted 4 (stale), step 7 wanted 6 and step 8 wanted 7 (lost), step 3 wanted 2 (late)
    told = accounts.told()
    assert {name: told[name] for name in ("steps", "on_time", "late", "stale", "lost", "repeated")} == {
        "steps": 10, "on_time": 6, "late": 1, "stale": 1, "lost": 2, "repeated": 1,
    }  # fmt: skip
    assert told["longest_silence_steps"] == 2


@given(st.lists(st.lists(st.integers(0, 39), max_size=4), min_size=40, max_size=40))
def test_every_step_is_accounted_for_once(arrivals: list[list[int]]) -> None:
    """Whatever comes in whatever order, of states that were published."""
    accounts = CommandAccounts(40, INITIAL, RAMP)
    on_time = 0
    seen: set[int] = {0}
    accounts.receive(0, command(0))
    for k in range(40):
        for answers in arrivals[k]:
            if answers < k:
                accounts.receive(answers, command(answers))
                seen.add(answers)
        on_time += k == 0 or k - 1 in seen
        chosen = accounts.choose()
        assert np.isfinite(chosen).all()
        assert accounts.newest == max(seen)
        if not accounts.in_neutral:
            assert chosen[3] == command(accounts.newest)[3]
    told = accounts.told()
    assert told["on_time"] == on_time
    assert told["lost"] == 39 - len(seen - {39})
    assert told["on_time"] + told["late"] + told["stale"] + told["lost"] == told["steps"] == 40
    assert min(told.values()) >= 0


def test_in_silence_alpha_goes_to_zero_gently_and_a_new_command_is_taken_at_once() -> None:
    accounts = CommandAccounts(40, INITIAL, RAMP)
    accounts.receive(0, INITIAL)
    chosen = [accounts.choose().copy() for _ in range(12)]
    # steps 1 .. 6 hold command 0 (silence 0 .. 5), from step 7 on the ramp goes on
    assert [c.tolist() for c in chosen[:7]] == [INITIAL.tolist()] * 7
    assert np.array(chosen[7:]).round(12).tolist() == [
        [8.0, 0.0, 0.0, alpha] for alpha in (0.7, 0.4, 0.1, 0.0, 0.0)
    ]
    assert accounts.told()["neutral_steps"] == 5
    accounts.receive(11, command(11))
    assert accounts.choose().tolist() == command(11).tolist()
    assert not accounts.in_neutral


class Clock:
    """A clock that a test turns."""

    def __init__(self) -> None:
        self.now_ns = 10**9

    def __call__(self) -> int:
        return self.now_ns


def pace_of(clock: Clock, step: Callable[[np.ndarray], bool]) -> RealTimePace:
    scenario = load_scenario("fast_turn_unknown_dynamics", {"duration_s": 0.42})
    return RealTimePace(scenario, INITIAL, 0.25, 0.5, step, clock)


def fly(ticks_ns: list[int], answers: Callable[[int], list[Answer]]) -> tuple[RealTimePace, list[int]]:
    """Tick at these times after the first command; the clock reading of each step [ns]."""
    clock = Clock()
    stepped: list[int] = []

    def step(_: np.ndarray) -> bool:
        stepped.append(clock.now_ns)
        return len(stepped) < 100

    pace = pace_of(clock, step)
    began_ns = clock.now_ns
    pace.tick([])
    assert not pace.begun
    for tick_ns in ticks_ns:
        clock.now_ns = began_ns + tick_ns
        pace.tick(answers(len(stepped)))
        if len(stepped) == 100:
            break
    return pace, [t - began_ns for t in stepped]


DT_NS = 4_200_000


def test_steps_keep_the_time_of_the_clock_whatever_the_timer_does() -> None:
    rng = np.random.default_rng(5)
    ticks = np.cumsum(rng.integers(1, 3 * DT_NS, size=400)).tolist()
    ticks = [0, *ticks]
    pace, stepped = fly(ticks, lambda k: [(k, INITIAL)])
    assert len(stepped) == 100
    for k, at_ns in enumerate(stepped, 1):
        before = max(t for t in ticks if t < at_ns)
        assert at_ns >= k * DT_NS  # never early
        assert before < k * DT_NS  # and at the first tick after it is due
    assert pace.late_steps == sum(t - k * DT_NS > DT_NS for k, t in enumerate(stepped, 1))
    told = pace.told()
    assert told["lateness_ms_max"] == pytest.approx(
        max(t - k * DT_NS for k, t in enumerate(stepped, 1)) * 1e-6
    )


def test_a_plant_that_was_held_up_catches_up() -> None:
    ticks = [k * DT_NS for k in range(30)] + [k * DT_NS for k in range(60, 200)]
    _, stepped = fly(ticks, lambda k: [(k, INITIAL)])
    assert stepped.count(60 * DT_NS) == 31
    assert all(b - a in (0, DT_NS, 31 * DT_NS) for a, b in pairwise(stepped))
    assert stepped[-1] == 100 * DT_NS


def test_the_sentences_say_what_went_wrong() -> None:
    pace, _ = fly([k * DT_NS for k in range(200)], lambda k: [(k, INITIAL)] if k < 10 else [])
    assert "89 of 100 steps held an older command (0 late, 0 stale, 89 lost)" in pace.sentence()
    assert "in the neutral posture" in pace.sentence()
    assert "no command answered a state after step 9 for" in pace.silence_sentence()
    perfect, _ = fly([k * DT_NS for k in range(200)], lambda k: [(k, INITIAL)])
    assert (perfect.sentence(), perfect.silence_sentence()) == ("", "")
