# SPDX-License-Identifier: Apache-2.0
"""Measured states that come late, at uneven times, or not at all."""

from collections.abc import Iterator
from typing import Annotated, Literal

import numpy as np

from skydiver_utc.arrays import Array, Integers
from skydiver_utc.disturbances.protocol import Disturbance
from skydiver_utc.disturbances.rows import BLOCK, Rows
from skydiver_utc.parameters.fields import SlotSettings, quantity
from skydiver_utc.plants.protocol import Plant


class Transmission(Disturbance):
    """The measured state is the newest that has arrived; it is held until a newer one arrives.

    That of step j arrives `delay` later, and later still by any whole number of steps up to `jitter`, all alike
    probable; a share of `loss` never arrives. The first state that is known counts until another one has arrived.
    """

    class Settings(SlotSettings):
        """Delay, jitter and loss."""

        kind: Literal["transmission"] = "transmission"
        delay_s: Annotated[float, quantity("s", "delay of every state, rounded to steps", ge=0, le=10)] = 0.0
        jitter_s: Annotated[float, quantity("s", "largest further delay, rounded to steps", ge=0, le=10)] = (
            0.0
        )
        loss: Annotated[float, quantity("1", "probability that a state never arrives", ge=0, le=0.99)] = 0.0

    def __init__(self, settings: Settings, plant: Plant, dt_s: float, seed: tuple[int, int]) -> None:
        self._delay, self._jitter = round(settings.delay_s / dt_s), round(settings.jitter_s / dt_s)
        self._loss, self._seed = settings.loss, seed
        self.acts = self._delay + self._jitter > 0 or self._loss > 0.0
        self._newest = Rows(self._blocks)
        self._states: dict[int, Array] = {}  # by step: the one in use, and later ones
        self._used = 0

    def measurement(self, k: int, state: Array) -> Array:
        if not self._states:
            self._used = k
        self._states[k] = state.copy()
        newest = int(self._newest[k])
        while newest > self._used and newest not in self._states:
            newest -= 1
        for j in range(self._used, newest):
            self._states.pop(j, None)
        self._used = max(self._used, newest)
        return self._states[self._used]

    def reset(self) -> None:
        self._states = {}

    def _blocks(self) -> Iterator[Integers]:
        """For each step the newest state that has arrived by then (BLOCK,)."""
        random = np.random.default_rng(self._seed)
        begin, newest = 0, np.full(BLOCK, -1)
        while True:
            late = random.integers(0, self._jitter + 1, BLOCK)
            lost = random.random(BLOCK) < self._loss
            arrived = np.full(2 * BLOCK + self._delay + self._jitter, -1)
            arrived[: len(newest)] = newest
            steps = np.flatnonzero(~lost)
            np.maximum.at(arrived, steps + self._delay + late[~lost], begin + steps)
            newest = np.maximum.accumulate(arrived)
            yield newest[:BLOCK]
            begin, newest = begin + BLOCK, newest[BLOCK:]
