"""In which order, and when, the messages of a recording are sent again; no clock and no ROS in here."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.recording.errors import RecordingError
from skydiver_utc.recording.reader import RecordedTopic


class Item(NamedTuple):
    """One message; times are those it was recorded at."""

    topic: str
    log_time_ns: int
    cdr: bytes


def in_order(topics: Mapping[str, RecordedTopic]) -> list[Item]:
    """All messages by log time; those of one time in the order of the topics, which is that of the bag.

    What was recorded before the flight's clock was heard comes with it: a recorder that was started in flight finds
    the latched messages first, and does not know yet how late it is.
    """
    clock = topics.get("/clock")
    begins_ns = int(clock.log_times_ns.min()) if clock else 0
    items = [
        Item(name, max(log_time, begins_ns), cdr)
        for name, topic in topics.items()
        for log_time, cdr in zip(topic.log_times_ns.tolist(), topic.cdr, strict=True)
    ]
    items.sort(key=lambda item: item.log_time_ns)
    return items


class Playback:
    """Which messages are due, at `rate` times the recorded speed, from `start_s` after the first message on.

    Begins paused. Every method is told the present time [s] of a steady clock; messages that came due while nobody
    asked are all due at the next call.
    """

    def __init__(self, log_times_ns: NDArray[np.int64], rate: float, start_s: float, loop: bool) -> None:
        if not (math.isfinite(rate) and rate > 0.0):
            raise RecordingError(f"A rate of {rate:g} cannot be played: give one above 0.")
        self._times = log_times_ns
        self.duration_s = float(log_times_ns[-1] - log_times_ns[0]) / 1e9
        if not 0.0 <= start_s <= self.duration_s:
            raise RecordingError(
                f"The recording is {self.duration_s:.3f} s long, it cannot begin at {start_s:g} s: choose"
                " another start."
            )
        self._rate = rate
        self._loop = loop
        start_ns = int(log_times_ns[0]) + round(start_s * 1e9)
        self.first = int(np.searchsorted(log_times_ns, start_ns))  # the message that it begins with
        self._next = self.first
        self._position_ns = float(log_times_ns[self.first])
        self._since_s: float | None = None  # when the position was that; None while paused
        self.lap = 0

    @property
    def paused(self) -> bool:
        """True while nothing comes due."""
        return self._since_s is None

    @property
    def finished(self) -> bool:
        """True when every message has been due."""
        return self._next == len(self._times)

    def resume(self, now_s: float) -> None:
        """Go on from where it was paused."""
        if self.paused:
            self._since_s = now_s

    def pause(self, now_s: float) -> None:
        """Stand still."""
        self._position_ns, self._since_s = self._position_at(now_s), None

    def position_s(self, now_s: float) -> float:
        """Recorded time since the first message, at most that of the last."""
        end = float(self._times[-1])
        return (min(self._position_at(now_s), end) - float(self._times[0])) / 1e9

    def due(self, now_s: float, limit: int) -> range:
        """The next messages that are due, at most `limit` of them, by their places in the order."""
        if self.paused:
            return range(0)
        if self.finished and self._loop:
            self.lap += 1
            self._next = self.first
            self._position_ns, self._since_s = float(self._times[self.first]), now_s
        end = int(np.searchsorted(self._times, self._position_at(now_s), side="right"))
        begin, self._next = self._next, max(self._next, min(end, self._next + limit))
        return range(begin, self._next)

    def _position_at(self, now_s: float) -> float:
        if self._since_s is None:
            return self._position_ns
        return self._position_ns + (now_s - self._since_s) * 1e9 * self._rate
