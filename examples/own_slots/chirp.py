# SPDX-License-Identifier: Apache-2.0
"""A reference of one's own: a sine of growing frequency."""

import math
from typing import Annotated

import numpy as np

from skydiver_utc import SlotSettings, quantity


class Chirp:
    """amplitude sin(pi growth t^2): the frequency grows by `growth_hz_s` each second."""

    class Settings(SlotSettings):
        """Size and speed of the sweep."""

        output: str = "yaw_rate"
        amplitude_deg_s: Annotated[float, quantity("deg/s", "amplitude", gt=0)] = 90.0
        growth_hz_s: Annotated[float, quantity("Hz/s", "growth of the frequency", gt=0)] = 0.05

    def __init__(self, settings: Settings, dt_s: float) -> None:
        self.outputs = (settings.output,)
        self.amplitude = np.array([math.radians(settings.amplitude_deg_s)])
        self._growth, self._dt_s = settings.growth_hz_s, dt_s

    def preview(self, k: int, count: int) -> np.ndarray:
        """Values (count, 1) [rad/s] at the steps k, k+1, ..."""
        time = self._dt_s * np.arange(k, k + count)
        return self.amplitude * np.sin(np.pi * self._growth * time**2)[:, None]
