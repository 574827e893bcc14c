"""When the messages of a recording are due, on a clock that the test moves."""

import numpy as np
import pytest

from skydiver_utc.recording.errors import RecordingError
from skydiver_utc.recording.playback import Playback, in_order
from skydiver_utc.recording.reader import RecordedTopic

START_NS = 1_700_000_000_000_000_000
TIMES_NS = START_NS + 100_000_000 * np.array([0, 0, 1, 2, 3, 3, 10])  # 0 to 1 s
MANY = 1000


def playing(rate: float = 1.0, start_s: float = 0.0, loop: bool = False, now_s: float = 50.0) -> Playback:
    playback = Playback(TIMES_NS, rate, start_s, loop)
    playback.resume(now_s)
    return playback


@pytest.mark.parametrize("rate", [0.25, 1.0, 8.0])
def test_messages_are_due_at_their_times(rate: float) -> None:
    playback = playing(rate)
    assert list(playback.due(50.0, MANY)) == [0, 1]
    assert list(playback.due(50.0 + 0.09 / rate, MANY)) == []
    assert list(playback.due(50.0 + 0.31 / rate, MANY)) == [2, 3, 4, 5]
    assert not playback.finished
    assert list(playback.due(50.0 + 1.01 / rate, MANY)) == [6]
    assert playback.finished
    assert list(playback.due(99.0, MANY)) == []


def test_what_was_missed_is_made_up_for_in_batches() -> None:
    playback = playing()
    assert [list(playback.due(60.0, 3)) for _ in range(3)] == [[0, 1, 2], [3, 4, 5], [6]]


def test_it_stands_still_while_paused() -> None:
    playback = Playback(TIMES_NS, 1.0, 0.0, False)
    assert playback.paused
    assert list(playback.due(1e6, MANY)) == []
    playback.resume(50.0)
    playback.resume(50.1)
    assert list(playback.due(50.15, MANY)) == [0, 1, 2]
    playback.pause(50.15)
    playback.pause(50.9)
    assert list(playback.due(60.0, MANY)) == []
    assert playback.position_s(60.0) == pytest.approx(0.15)
    playback.resume(70.0)
    assert list(playback.due(70.04, MANY)) == []
    assert list(playback.due(70.06, MANY)) == [3]


def test_it_begins_where_it_is_told() -> None:
    playback = playing(start_s=0.15)
    assert playback.first == 3
    assert list(playback.due(50.0, MANY)) == [3]
    assert playback.position_s(50.1) == pytest.approx(0.3)
    assert playback.position_s(500.0) == pytest.approx(1.0)


def test_a_loop_begins_again_where_it_began() -> None:
    playback = playing(start_s=0.2, loop=True)
    assert list(playback.due(51.0, MANY)) == [3, 4, 5, 6]
    assert list(playback.due(51.3, MANY)) == [3]
    assert list(playback.due(51.45, MANY)) == [4, 5]
    assert playback.lap == 1


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan"), float("inf")])
def test_impossible_rates(rate: float) -> None:
    with pytest.raises(RecordingError, match="cannot be played"):
        Playback(TIMES_NS, rate, 0.0, False)


@pytest.mark.parametrize("start_s", [-0.1, 1.1, float("nan")])
def test_impossible_starts(start_s: float) -> None:
    with pytest.raises(RecordingError, match="cannot begin"):
        Playback(TIMES_NS, 1.0, start_s, False)


def topic(name: str, *times_ns: int) -> RecordedTopic:
    times = np.array(times_ns, dtype=np.int64)
    return RecordedTopic(name, "", [name.encode()] * len(times), times, times, frozenset())


def test_what_a_late_recorder_found_latched_comes_with_the_first_clock() -> None:
    """It is logged at the flight's beginning: nobody waits for the steps that were not recorded."""
    topics = {
        t.name: t for t in (topic("/a/scenario", 0), topic("/clock", 500, 600), topic("/a/state", 500, 600))
    }
    order = [(item.topic, item.log_time_ns) for item in in_order(topics)]
    assert order == [
        ("/a/scenario", 500),
        ("/clock", 500),
        ("/a/state", 500),
        ("/clock", 600),
        ("/a/state", 600),
    ]
    without_clock = in_order({"/a/scenario": topics["/a/scenario"], "/a/state": topics["/a/state"]})
    assert [item.log_time_ns for item in without_clock] == [0, 500, 600]
