# SPDX-License-Identifier: Apache-2.0
"""Measured states that come late, at uneven times, or not at all."""

from collections.abc import Iterator
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.disturbances.protocol import Disturbance
from skydiver_utc.disturbances.rows import BLOCK, Rows
from skydiver_utc.parameters.fields import SlotSettings, quantity
from skydiver_utc.plants.protocol import Plant

Array = NDArray[np.float64]


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
        self._arrivals = Rows(self._blocks)
        self._states: dict[int, Array] = {}  # by step: the one in use, and those that may still arrive
        self._due: dict[int, float] = {}  # by step: the step at which its state arrives
        self._newest = self._next = 0  # the newest that has arrived, and the first that is not due yet

    def measurement(self, k: int, state: Array) -> Array:
        """The state (n,) that arrived last at step k."""
        if not self._states:
            self._newest = self._next = k
        self._states[k] = state.copy()
        while self._next <= k:
            self._due[self._next] = float(self._arrivals[self._next][0])
            self._next += 1
        self._newest = max([self._newest, *(j for j, at in self._due.items() if at <= k)])
        self._due = {j: at for j, at in self._due.items() if j > self._newest and at < np.inf}
        used = max((j for j in self._states if j <= self._newest), default=min(self._states))
        self._states = {j: known for j, known in self._states.items() if j >= used}
        return self._states[used]

    def reset(self) -> None:
        """Forget all states."""
        self._states, self._due = {}, {}

    def _blocks(self) -> Iterator[Array]:
        """The step at which the state of each step arrives (BLOCK, 1), infinite where it is lost."""
        random = np.random.default_rng(self._seed)
        steps = np.arange(BLOCK)
        while True:
            late = random.integers(0, self._jitter + 1, BLOCK)
            arrivals = np.where(random.random(BLOCK) < self._loss, np.inf, steps + self._delay + late)
            yield arrivals[:, np.newaxis]
            steps = steps + BLOCK
