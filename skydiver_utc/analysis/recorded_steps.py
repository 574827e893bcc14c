"""The messages of a recording by their steps: strangers' ones are left out and counted."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.parameters import Scenario
from skydiver_utc.recording.reader import RecordedTopic

Floats = NDArray[np.float64]
Times = NDArray[np.int64]
_UNKNOWN = np.iinfo(np.int64).min


class Rows(NamedTuple):
    """Values by step, (steps + 1, width), NaN where `present` (steps + 1,) is False; when each was sent [ns]."""

    values: Floats
    present: NDArray[np.bool_]
    sent_ns: Times

    @property
    def first(self) -> int | None:
        """The first step present, None without any."""
        steps = np.flatnonzero(self.present)
        return int(steps[0]) if len(steps) else None

    @property
    def last(self) -> int:
        """The last step present, -1 without any."""
        steps = np.flatnonzero(self.present)
        return int(steps[-1]) if len(steps) else -1

    def held(self) -> "Rows":
        """Each step without a value has that of the step before it."""
        newest = np.maximum.accumulate(np.where(self.present, np.arange(len(self.present)), -1))
        return Rows(self.values[newest], newest >= 0, self.sent_ns[newest])


class RecordedSteps:
    """The topics of one flight; `ignored` counts, by topic, what has no step in it or cannot be understood."""

    def __init__(self, scenario: Scenario, topics: Mapping[str, RecordedTopic], namespace: str) -> None:
        self.ignored: dict[str, int] = {}
        self._scenario, self._topics, self._namespace = scenario, topics, namespace

    def messages(self, name: str) -> list[Any | None]:
        """The messages of a topic, in the order of the file; None for bytes that are none."""
        topic = self._topics.get(f"{self._namespace}/{name}")
        return topic.readable if topic else []

    def step_of(self, message: Any | None) -> int | None:
        """The step of a message's stamp; None off the grid, outside of the flight and for what is no message."""
        if message is None:
            return None
        stamp = message.header.stamp
        after_ns = stamp.sec * 1_000_000_000 + stamp.nanosec - self._scenario.stamp_ns(0)
        k, rest = divmod(after_ns, self._scenario.dt_ns)
        return None if rest or not 0 <= k <= self._scenario.steps else int(k)

    def with_steps(self, name: str) -> list[tuple[int, Any]]:
        """Step and message of those that have one."""
        found = [(self.step_of(message), message) for message in self.messages(name)]
        kept = [(k, message) for k, message in found if k is not None]
        self.count(name, len(found) - len(kept))
        return kept

    def count(self, name: str, ignored: int) -> None:
        """So many messages of a topic were left out."""
        if ignored:
            self.ignored[name] = ignored

    def rows(
        self, name: str, width: int, values_of: Callable[[Any], Any], not_before_ns: Times | None = None
    ) -> Rows:
        """Of several messages of one step the first that was sent in time, finite ones before others.

        In time is a message not sent before `not_before_ns` (steps + 1,), what it answers or tells of; without it,
        not before the message of the step before. Where none was, the first counts.
        """
        size = self._scenario.steps + 1
        rows = Rows(np.full((size, width), np.nan), np.zeros(size, np.bool_), np.full(size, _UNKNOWN))
        found, ignored = self._candidates(name, width, values_of)
        self.count(name, ignored)
        earliest_ns = _UNKNOWN
        for k in sorted(found):
            if not_before_ns is not None:
                earliest_ns = int(not_before_ns[k])
            in_time = [one for one in found[k] if one[0] >= earliest_ns] or found[k]
            finite = [one for one in in_time if np.isfinite(one[1]).all()] or in_time
            earliest_ns, rows.values[k] = finite[0]
            rows.present[k], rows.sent_ns[k] = True, earliest_ns
        return rows

    def _candidates(
        self, name: str, width: int, values_of: Callable[[Any], Any]
    ) -> tuple[dict[int, list[tuple[int, Any]]], int]:
        """By step, when each message was sent and what it says; and how many say nothing."""
        topic = self._topics.get(f"{self._namespace}/{name}")
        found: dict[int, list[tuple[int, Any]]] = {}
        ignored = 0
        for message, sent_ns in zip(topic.readable, topic.publish_times_ns, strict=True) if topic else ():
            k = self.step_of(message)
            values = None if k is None else values_of(message)
            if k is None or values is None or len(values) != width:
                ignored += 1
            else:
                found.setdefault(k, []).append((int(sent_ns), values))
        return found, ignored
