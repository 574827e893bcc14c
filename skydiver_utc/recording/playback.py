# SPDX-License-Identifier: Apache-2.0
"""The order and the times at which a replay sends recorded messages; no clock and no ROS."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from skydiver_utc.arrays import Integers
from skydiver_utc.errors import RecordingError
from skydiver_utc.parameters.nanoseconds import NANOSECONDS
from skydiver_utc.recording.reader import RecordedTopic, namespace_of

CLOCK_TYPE = "rosgraph_msgs/msg/Clock"
# Logs and parameter events of the recorded nodes would stand among those of today's.
_OF_NODES = ("rcl_interfaces/msg/Log", "rcl_interfaces/msg/ParameterEvent")


class Item(NamedTuple):
    """One recorded message."""

    topic: str
    log_time_ns: int
    cdr: bytes


def in_order(topics: Mapping[str, RecordedTopic]) -> list[Item]:
    """All messages by log time, those of one time in the order of the bag."""
    items = [
        (log_time, place, Item(topic.name, log_time, cdr))
        for topic in topics.values()
        for log_time, place, cdr in zip(topic.log_times_ns.tolist(), topic.places, topic.cdr, strict=True)
    ]
    return [item for _, _, item in sorted(items)]


def chosen(recorded: Mapping[str, RecordedTopic], names: Sequence[str]) -> dict[str, RecordedTopic]:
    """The topics with these names, relative or not, and clocks; without names all but logs. Raises `RecordingError`."""
    relative = [name for name in names if not name.startswith("/")]
    namespace = namespace_of(recorded) if relative else ""
    wanted = {f"{namespace}/{name}" if name in relative else name for name in names}
    if not names:
        wanted = {name for name, topic in recorded.items() if topic.type_name not in _OF_NODES}
    for name in sorted(wanted - recorded.keys()):
        raise RecordingError(f"the recording has no topic {name}: choose from {', '.join(sorted(recorded))}")
    return {
        name: topic for name, topic in recorded.items() if name in wanted or topic.type_name == CLOCK_TYPE
    }


class Playback:
    """Which messages are due at a time of a steady clock.

    `log_times_ns` (n,) rising, n > 0; playing begins `start_s` >= 0 after the first message at `rate` > 0 times the
    recorded speed. With `loop` it begins again after the last message.
    """

    def __init__(self, log_times_ns: Integers, rate: float, start_s: float, loop: bool) -> None:
        self.duration_s = float(log_times_ns[-1] - log_times_ns[0]) / NANOSECONDS
        if start_s > self.duration_s:
            raise RecordingError(
                f"The start is {start_s:g} s, the recording is {self.duration_s:.3f} s long: start earlier."
            )
        start_ns = int(log_times_ns[0]) + round(start_s * NANOSECONDS)
        self.first = int(np.searchsorted(log_times_ns, start_ns))  # place of the first message that is played
        self._due_s = (log_times_ns - log_times_ns[self.first]) / (
            NANOSECONDS * rate
        )  # from the begin of playing
        self._loop = loop
        self._next = self.first
        self._began_s: float | None = None

    @property
    def finished(self) -> bool:
        """True when every message has been due, never with `loop`."""
        return self._next == len(self._due_s) and not self._loop

    def due(self, now_s: float, limit: int) -> range:
        """Places of the next messages that are due, at most `limit`; the first call begins the playing."""
        if self._began_s is None or (self._next == len(self._due_s) and self._loop):
            self._began_s, self._next = now_s, self.first
        end = int(np.searchsorted(self._due_s, now_s - self._began_s, side="right"))
        begin, self._next = self._next, max(self._next, min(end, self._next + limit))
        return range(begin, self._next)
