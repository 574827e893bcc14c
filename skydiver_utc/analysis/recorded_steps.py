# SPDX-License-Identifier: Apache-2.0
"""The messages of a recording by their steps; those that cannot be used are left out and counted."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from skydiver_utc.arrays import Array, Flags
from skydiver_utc.messages import MessageError, StepGrid, read_named
from skydiver_utc.parameters import Scenario
from skydiver_utc.recording.reader import RecordedTopic


class Rows(NamedTuple):
    """Values by step, (steps + 1, width), NaN where `present` (steps + 1,) is False."""

    values: Array
    present: Flags

    @property
    def first(self) -> int:
        """The first step present, 0 without any."""
        return int(np.argmax(self.present))

    @property
    def last(self) -> int:
        """The last step present, -1 without any."""
        return int(np.max(np.flatnonzero(self.present), initial=-1))

    def held(self) -> "Rows":
        """Each step without a value has that of the step before it."""
        newest = np.maximum.accumulate(np.where(self.present, np.arange(len(self.present)), -1))
        return Rows(self.values[newest], newest >= 0)


def stretches(marked: Flags) -> list[tuple[int, int]]:
    """First and last place of each unbroken row of marked ones."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], marked, [False]))))
    return [(int(begin), int(end) - 1) for begin, end in edges.reshape(-1, 2)]


class RecordedSteps:
    """The topics of one run; `ignored` counts, by topic, the messages without a step of the run or of no use."""

    def __init__(self, scenario: Scenario, topics: Mapping[str, RecordedTopic], namespace: str) -> None:
        self.ignored: dict[str, int] = {}
        self.grid = StepGrid(scenario.stamp_ns(0), scenario.dt_ns)
        self._steps, self._topics, self._namespace = scenario.steps, topics, namespace

    def read(self, name: str, read: Callable[[Any], Any]) -> list[Any]:
        """`read` of each message of a topic, in the order of the file; without those that it cannot read."""
        topic = self._topics.get(f"{self._namespace}/{name}")
        found, messages = [], topic.readable if topic else []
        for message in messages:
            try:
                if message is not None:  # bytes that cannot be decoded
                    found.append(read(message))
            # A `MessageError`, a type with other fields, or a text that is none of ours.
            except (ValueError, AttributeError, TypeError, KeyError, OverflowError, RecursionError):
                continue
        self.ignored[name] = len(messages) - len(found) + (topic.left_out if topic else 0)
        return found

    def step_of(self, message: Any) -> int:
        """The step of a message's stamp; `MessageError` off the grid and outside of the run."""
        k = self.grid.step_of(message.header.stamp)
        if k > self._steps:
            raise MessageError("stamp", f"its step {k} is after the end")
        return k

    def named(self, name: str, values: tuple[str, ...], finite: bool = True) -> Rows:
        """The values of these names of each step, from messages that name theirs."""
        return self.rows(name, len(values), lambda message: read_named(message, values, finite=finite))

    def rows(self, name: str, width: int, read: Callable[[Any], Array]) -> Rows:
        """The values (width,) of each step; of several messages of one step the first counts."""
        size = self._steps + 1
        rows = Rows(np.full((size, width), np.nan), np.zeros(size, np.bool_))
        for k, values in self.read(name, lambda message: (self.step_of(message), read(message))):
            if not rows.present[k]:
                rows.values[k], rows.present[k] = values, True
        return rows
