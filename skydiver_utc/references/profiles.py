# SPDX-License-Identifier: Apache-2.0
"""Reference profiles for one output each: settings and formula together.

An amplitude is given in the unit of the output, or in degrees (per second) under the name with `_deg`.
"""

import math
from abc import ABC, abstractmethod
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator
from typing_extensions import Self

from skydiver_utc.parameters.fields import SlotSettings, quantity, text

Array = NDArray[np.float64]

Seconds = Annotated[float, quantity("s", "simulated time", ge=0, le=36000)]
Output = Annotated[str, text("name of the tracked output of the plant")]
# Fewer steps would not show a rotation's rise and fall.
_SHORTEST_ROTATION = 10


class Profile(ABC):
    """A reference for one output, as a function of the step."""

    def __init__(self, output: str, amplitude: float, dt_s: float) -> None:
        self.outputs: tuple[str, ...] = (output,)
        self.amplitude: Array = np.array([amplitude])
        self.dt_s = dt_s

    @abstractmethod
    def value(self, time_s: float) -> float:
        """The value wanted at a time, in the unit of the output."""

    def preview(self, k: int, count: int) -> Array:
        """Values (count, 1) at the steps k, k+1, ...; one by one, so that every preview has the same bits."""
        return np.array([[self.value((k + i) * self.dt_s)] for i in range(count)]).reshape(count, 1)


class Sine(Profile):
    """amplitude sin(2 pi frequency t), eq:yr_com."""

    class Settings(SlotSettings):
        """A sine."""

        kind: Literal["sine"] = "sine"
        output: Output = "yaw_rate"
        amplitude: Annotated[float, quantity("unit of the output", "amplitude", ge=-1e6, le=1e6)] = 0.0
        amplitude_deg_s: Annotated[
            float, quantity("deg/s", "amplitude of a rate, positive first to the left", ge=-2000, le=2000)
        ] = 0.0
        frequency_hz: Annotated[float, quantity("Hz", "frequency", gt=0, le=10)]

        @model_validator(mode="after")
        def _check(self) -> Self:
            if self.amplitude and self.amplitude_deg_s:
                raise ValueError("amplitude and amplitude_deg_s are both given: keep one")
            return self

    def __init__(self, settings: Settings, dt_s: float) -> None:
        self._amplitude = settings.amplitude or math.radians(settings.amplitude_deg_s)
        self._frequency_hz = settings.frequency_hz
        super().__init__(settings.output, abs(self._amplitude), dt_s)

    def value(self, time_s: float) -> float:
        """The sine at a time."""
        phase = 2.0 * math.pi * self._frequency_hz * time_s
        return self._amplitude * math.sin(phase)


class Constant:
    """Constant values of one or more outputs."""

    class Settings(SlotSettings):
        """Constant values by output; a yaw rate of zero is a straight fall."""

        kind: Literal["constant"] = "constant"
        values: Annotated[
            dict[str, float], quantity("unit of the output", "value of each output, in its unit")
        ]

        @model_validator(mode="after")
        def _check(self) -> Self:
            if not self.values:
                raise ValueError("values is empty: name at least one output")
            return self

    def __init__(self, settings: Settings, dt_s: float) -> None:
        self.outputs = tuple(settings.values)
        self._values: Array = np.array(list(settings.values.values()))
        self.amplitude: Array = np.abs(self._values)

    def preview(self, k: int, count: int) -> Array:
        """The values (count, l)."""
        return np.tile(self._values, (count, 1))


class Rotation(Profile):
    """The rate of a rotation by an angle: angle / duration (1 - cos(2 pi (t - start) / duration))."""

    class Settings(SlotSettings):
        """A rotation by an angle."""

        kind: Literal["rotation"] = "rotation"
        output: Annotated[str, text("name of the tracked rate")] = "yaw_rate"
        angle_deg: Annotated[
            float,
            quantity("deg", "angle to turn through, positive to the left or head down", ge=-3600, le=3600),
        ]
        duration_s: Annotated[float, quantity("s", "length of the rotation", gt=0, le=600)]
        start_s: Seconds = 0.0

    def __init__(self, settings: Settings, dt_s: float) -> None:
        if settings.duration_s < _SHORTEST_ROTATION * dt_s:
            raise ValueError(
                f"reference.duration_s is {settings.duration_s}: give at least {_SHORTEST_ROTATION} steps of dt_s"
            )
        self._mean = math.radians(settings.angle_deg) / settings.duration_s
        self._start_s, self._duration_s = settings.start_s, settings.duration_s
        super().__init__(settings.output, 2.0 * abs(self._mean), dt_s)

    def value(self, time_s: float) -> float:
        """The rate at a time."""
        share = min(max((time_s - self._start_s) / self._duration_s, 0.0), 1.0)
        return self._mean * (1.0 - math.cos(2.0 * math.pi * share))


class Points(Profile):
    """Straight lines between points (time, value); constant before the first and after the last."""

    class Settings(SlotSettings):
        """Points in time, for example the pattern angle of an open-loop maneuver."""

        kind: Literal["points"] = "points"
        output: Output
        points: Annotated[tuple[tuple[Seconds, float], ...], text("time [s] and value of each point")]

        @model_validator(mode="after")
        def _check(self) -> Self:
            times = [time_s for time_s, _ in self.points]
            if not times:
                raise ValueError("points is empty: give at least one, [time, value]")
            if any(after <= before for before, after in pairwise(times)):
                raise ValueError(
                    f"the points must be in the order of growing time, they are at {times}: sort them"
                )
            return self

    def __init__(self, settings: Settings, dt_s: float) -> None:
        self._times, self._values = zip(*settings.points, strict=True)
        super().__init__(settings.output, max(map(abs, self._values)), dt_s)

    def value(self, time_s: float) -> float:
        """The value on the line at a time."""
        return float(np.interp(time_s, self._times, self._values))
