# SPDX-License-Identifier: Apache-2.0
"""A reference that is a function of time, as previews on the grid of steps."""

import math
from abc import abstractmethod
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.parameters.fields import SlotSettings

# Fewer steps would not show a period's rise and fall.
_STEPS_OF_A_PERIOD = 10


class Curve(NamedTuple):
    """Values (l,) of the outputs at a time [s] of the run.

    largest: largest absolute value of each output (l,); shortest_s: its shortest period or transition, inf for none
    """

    outputs: tuple[str, ...]
    largest: Array
    value: Callable[[float], Array]
    shortest_s: float = math.inf


class CurveSettings(SlotSettings):
    """Settings of a reference that is a function of time."""

    @abstractmethod
    def curve(self) -> Curve:
        """The function of time. Raises ValueError."""


@lru_cache(maxsize=8)
def _values_of(settings: CurveSettings, dt_s: float) -> Callable[[int], Array]:
    """Values at a step, kept for references of equal settings: for all flights of a study."""
    value = settings.curve().value
    return lru_cache(maxsize=8192)(lambda k: value(k * dt_s))


class CurveReference:
    """Previews of a curve; each step is computed by itself and once, so that every preview has the same bits."""

    def __init__(self, settings: CurveSettings, dt_s: float) -> None:
        curve = settings.curve()
        if curve.shortest_s < _STEPS_OF_A_PERIOD * dt_s:
            raise ValueError(
                f"its shortest period is {curve.shortest_s:g} s: give it at least {_STEPS_OF_A_PERIOD} steps of"
                f" dt_s ({dt_s:g} s)"
            )
        self.outputs, self.amplitude = curve.outputs, curve.largest
        self._at = _values_of(settings, dt_s)

    def preview(self, k: int, count: int) -> Array:
        """Values (count, l) at the steps k, k+1, ..., in the unit of each output."""
        values = [np.empty(0), *(self._at(i) for i in range(k, k + count))]
        return np.concatenate(values).reshape(count, len(self.outputs))
