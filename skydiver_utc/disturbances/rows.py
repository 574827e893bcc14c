# SPDX-License-Identifier: Apache-2.0
"""Random numbers by step: the same bits whoever asks for them, how often, and with which gaps."""

from collections.abc import Callable, Iterator
from typing import Any

from numpy.typing import NDArray

Array = NDArray[Any]
BLOCK = 128  # steps that are drawn at once: in real time they take a fraction of a step


class Rows:
    """Row k of an endless table whose blocks (BLOCK, width) are made in order; an earlier step begins it anew.

    `blocks` starts the table; the newest two blocks are kept.
    """

    def __init__(self, blocks: Callable[[], Iterator[Array]]) -> None:
        self._blocks = blocks
        self._begin()

    def _begin(self) -> None:
        self._source, self._newest = self._blocks(), 0
        self._now: Array = next(self._source)
        self._before = self._now

    def __getitem__(self, k: int) -> Array:
        block, row = divmod(k, BLOCK)
        if block < self._newest - 1:
            self._begin()
        while block > self._newest:
            self._before = self._now
            self._now = next(self._source)
            self._newest += 1
        found: Array = (self._now if block == self._newest else self._before)[row]
        return found
