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
        self._acts = self._delay + self._jitter > 0 or self._loss > 0.0
        self._arrivals = Rows(self._blocks)
        self._states: dict[int, Array] = {}  # by step: the one in use, and later ones
        self._arriving: dict[float, int] = {}  # by the step at which it arrives: the step of a state
        self._used = self._newest = self._next = 0

    def measurement(self, k: int, state: Array) -> Array:
        """The state (n,) that arrived last at step k."""
        if not self._acts:
            return state
        if not self._states:
            self._used = self._newest = self._next = k
        self._states[k] = state.copy()
        for step in range(self._next, k + 1):
            self._arriving[self._arrivals[step][0]] = step  # of several at once the newest counts
            self._newest = max(self._newest, self._arriving.pop(step, -1))
        self._next = k + 1
        used = next(j for j in range(self._newest, self._used - 1, -1) if j in self._states)
        for j in range(self._used, used):
            self._states.pop(j, None)
        self._used = used
        return self._states[used]

    def reset(self) -> None:
        """Forget all states."""
        self._states, self._arriving = {}, {}

    def _blocks(self) -> Iterator[Array]:
        """The step at which the state of each step arrives (BLOCK, 1), infinite where it is lost."""
        random = np.random.default_rng(self._seed)
        steps = np.arange(BLOCK)
        while True:
            late = random.integers(0, self._jitter + 1, BLOCK)
            arrivals = np.where(random.random(BLOCK) < self._loss, np.inf, steps + self._delay + late)
            yield arrivals[:, np.newaxis]
            steps = steps + BLOCK
