"""Yaw-rate profiles on the global grid of steps: the same number for the same step, whoever asks."""

import math

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.parameters import Scenario, SineReference

Array = NDArray[np.float64]


class YawRateReference:
    """The scenario's profile, indexed by step."""

    def __init__(self, scenario: Scenario) -> None:
        self._profile = scenario.reference
        self._dt_s = scenario.dt_s

    def value(self, k: int) -> float:
        """Yaw rate [rad/s] wanted at step k."""
        profile = self._profile
        if isinstance(profile, SineReference):
            phase = 2.0 * math.pi * profile.frequency_hz * (k * self._dt_s)
            return math.radians(profile.amplitude_deg_s) * math.sin(phase)
        return math.radians(profile.yaw_rate_deg_s)

    def preview(self, k: int, count: int) -> Array:
        """Yaw rates (count,) [rad/s] at steps k, k+1, ...; one by one, so that chunks agree to the bit."""
        return np.array([self.value(k + i) for i in range(count)])
