# SPDX-License-Identifier: Apache-2.0
"""An estimator of one's own: the body rates smoothed over time."""

from typing import Annotated

import numpy as np

from skydiver_utc import Estimator, Plant, SlotSettings, quantity


class Smoothing(Estimator):
    """A first-order low-pass filter on the last three states; all others are handed on."""

    class Settings(SlotSettings):
        """The filter."""

        time_constant_s: Annotated[float, quantity("s", "time constant", gt=0)] = 0.02

    def __init__(self, settings: Settings, plant: Plant, dt_s: float) -> None:
        self._share = 1.0 - np.exp(-dt_s / settings.time_constant_s)
        self.reset()

    def reset(self) -> None:
        """Begin from the next measurement."""
        self._rates: np.ndarray | None = None

    def update(self, measurement: np.ndarray) -> np.ndarray:
        """The state (n,) with smoothed rates."""
        measured = measurement[-3:]
        self._rates = (
            measured if self._rates is None else self._rates + self._share * (measured - self._rates)
        )
        return np.concatenate([measurement[:-3], self._rates])
