# SPDX-License-Identifier: Apache-2.0
"""The order of recorded messages, and when each is due."""

from pathlib import Path

import numpy as np
import pytest

from bags import START_NS, Row, text_message, write_bag
from skydiver_utc.errors import RecordingError
from skydiver_utc.recording.playback import CLOCK_TYPE, Playback, chosen, in_order
from skydiver_utc.recording.reader import RecordedTopic, read_bag

TIMES_NS = START_NS + 100_000_000 * np.array([0, 0, 1, 2, 3, 3, 10])  # 0 to 1 s
MANY = 1000


@pytest.mark.parametrize("rate", [0.25, 1.0, 8.0])
def test_messages_are_due_at_their_times(rate: float) -> None:
    playback = Playback(TIMES_NS, rate, 0.0, False)
    assert list(playback.due(50.0, MANY)) == [0, 1]
    assert list(playback.due(50.0 + 0.09 / rate, MANY)) == []
    assert list(playback.due(50.0 + 0.31 / rate, MANY)) == [2, 3, 4, 5]
    assert not playback.finished
    assert list(playback.due(50.0 + 1.01 / rate, MANY)) == [6]
    assert playback.finished
    assert list(playback.due(99.0, MANY)) == []


def test_late_messages_come_in_batches() -> None:
    playback = Playback(TIMES_NS, 1.0, 0.0, False)
    assert list(playback.due(50.0, 1)) == [0]
    assert [list(playback.due(60.0, 3)) for _ in range(2)] == [[1, 2, 3], [4, 5, 6]]


def test_a_loop_begins_again_at_its_start() -> None:
    playback = Playback(TIMES_NS, 1.0, 0.2, True)
    assert playback.first == 3
    assert list(playback.due(50.0, MANY)) == [3]
    assert list(playback.due(51.0, MANY)) == [4, 5, 6]
    assert not playback.finished
    assert list(playback.due(51.3, MANY)) == [3]
    assert list(playback.due(51.45, MANY)) == [4, 5]


def test_a_start_beyond_the_end_is_refused() -> None:
    with pytest.raises(RecordingError, match="start"):
        Playback(TIMES_NS, 1.0, 1.1, False)
    assert Playback(TIMES_NS, 1.0, 1.0, False).first == 6
    assert Playback(TIMES_NS[1:], 1.0, 1.0, False).first == 5


def test_messages_of_one_time_keep_the_order_of_the_bag(tmp_path: Path) -> None:
    times = [("/b", 600), ("/clock", 500), ("/a", 500), ("/b", 500), ("/clock", 600), ("/a", 600)]
    rows = [Row(name, time_ns, 0, text_message(f"{name} {time_ns}")) for name, time_ns in times]
    items = in_order(read_bag(write_bag(tmp_path / "bag", rows)))
    ordered = sorted(rows, key=lambda row: row.log_time)
    assert [(i.topic, i.log_time_ns, i.cdr) for i in items] == [(r.topic, r.log_time, r.cdr) for r in ordered]


@pytest.mark.parametrize(
    ("names", "found"),
    [
        ([], ["/a/scenario", "/a/state", "/clock"]),
        (["state"], ["/a/state", "/clock"]),
        (["/a/scenario"], ["/a/scenario", "/clock"]),
        (["/rosout", "state"], ["/a/state", "/clock", "/rosout"]),
    ],
)
def test_topics_are_chosen_by_name_in_the_recorded_namespace(names: list[str], found: list[str]) -> None:
    types = {"/clock": CLOCK_TYPE, "/rosout": "rcl_interfaces/msg/Log"}
    recorded = {
        name: RecordedTopic(name, types.get(name, "any/msg/Type"), "")
        for name in ("/a/scenario", "/a/state", "/clock", "/rosout")
    }
    assert sorted(chosen(recorded, names)) == found
    with pytest.raises(RecordingError, match="/a/nothing"):
        chosen(recorded, [*names, "nothing"])
