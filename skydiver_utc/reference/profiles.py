"""Reference profiles on the global grid of steps: the same number for the same step, whoever asks."""

import math

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.parameters import ConstantReference, RotationReference, Scenario, SineReference

Array = NDArray[np.float64]


class ReferenceProfile:
    """The scenario's profile, indexed by step: a body rate [rad/s] or the pattern angle [rad], as `signal` says."""

    def __init__(self, scenario: Scenario) -> None:
        self._profile = scenario.reference
        self._dt_s = scenario.dt_s
        self.signal = scenario.reference.signal

    def value(self, k: int) -> float:
        """What is wanted at step k."""
        profile, time_s = self._profile, k * self._dt_s
        if isinstance(profile, SineReference):
            phase = 2.0 * math.pi * profile.frequency_hz * time_s
            return math.radians(profile.amplitude_deg_s) * math.sin(phase)
        if isinstance(profile, ConstantReference):
            return math.radians(profile.yaw_rate_deg_s)
        if isinstance(profile, RotationReference):
            share = min(max((time_s - profile.start_s) / profile.duration_s, 0.0), 1.0)
            mean = math.radians(profile.angle_deg) / profile.duration_s
            return mean * (1.0 - math.cos(2.0 * math.pi * share))
        times, alphas = zip(*profile.points, strict=True)
        return float(np.interp(time_s, times, alphas))

    def preview(self, k: int, count: int) -> Array:
        """Values (count,) at steps k, k+1, ...; one by one, so that chunks agree to the bit."""
        return np.array([self.value(k + i) for i in range(count)])


class ChangingReference:
    """A profile that others follow from later steps on; what it says of earlier steps stays."""

    def __init__(self, profile: ReferenceProfile) -> None:
        self.signal = profile.signal
        self._parts = [(0, profile)]  # from step, in order

    @property
    def changed_at(self) -> int:
        """The step from which on the newest profile holds."""
        return self._parts[-1][0]

    def follow(self, k: int, profile: ReferenceProfile) -> None:
        """From step k on this profile holds, and none that was to come after k."""
        self._parts = [part for part in self._parts if part[0] < k] + [(k, profile)]

    def value(self, k: int) -> float:
        """What is wanted at step k."""
        return next(profile for first, profile in reversed(self._parts) if first <= k).value(k)

    def preview(self, k: int, count: int) -> Array:
        """Values (count,) at steps k, k+1, ..."""
        return np.array([self.value(k + i) for i in range(count)])
