# SPDX-License-Identifier: Apache-2.0
"""A reference of one's own: a triangle wave."""

import math
from typing import Annotated

import numpy as np

from skydiver_utc import SlotSettings, quantity


class Triangle:
    """Straight lines from 0 to the amplitude, to its opposite and back, period after period."""

    class Settings(SlotSettings):
        """Size and period of the wave."""

        output: str = "yaw_rate"
        amplitude_deg_s: Annotated[float, quantity("deg/s", "amplitude", gt=0)] = 90.0
        period_s: Annotated[float, quantity("s", "period", gt=0)] = 4.0

    def __init__(self, settings: Settings, dt_s: float) -> None:
        self.outputs = (settings.output,)
        self.amplitude = np.array([math.radians(settings.amplitude_deg_s)])
        self._period_s, self._dt_s = settings.period_s, dt_s

    def preview(self, k: int, count: int) -> np.ndarray:
        """Values (count, 1) [rad/s] at the steps k, k+1, ..."""
        cycles = self._dt_s / self._period_s * np.arange(k, k + count)
        return self.amplitude * (4.0 * np.abs((cycles + 0.75) % 1.0 - 0.5) - 1.0)[:, None]
