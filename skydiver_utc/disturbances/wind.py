# SPDX-License-Identifier: Apache-2.0
"""Winds that are functions of time: steady, and a gust."""

import math
from typing import Annotated, Literal

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.disturbances.protocol import STILL_AIR, Disturbance
from skydiver_utc.parameters.fields import SlotSettings, quantity
from skydiver_utc.plants.protocol import Plant


class WindSettings(SlotSettings):
    """Speed and direction of a wind."""

    speed_m_s: Annotated[float, quantity("m/s", "largest speed of the wind", ge=0, le=50)]
    to_deg: Annotated[
        float, quantity("deg", "where the wind blows to, counter-clockwise from east", ge=-360, le=360)
    ] = 90.0
    up_deg: Annotated[float, quantity("deg", "how far upwards the wind blows", ge=-90, le=90)] = 0.0

    @property
    def velocity(self) -> Array:
        """At its largest (3,), in the world [m/s]."""
        to, up = math.radians(self.to_deg), math.radians(self.up_deg)
        level = math.cos(up)
        return self.speed_m_s * np.array([level * math.cos(to), level * math.sin(to), math.sin(up)])


class SteadyWind(Disturbance):
    """Air that moves evenly from before the start on."""

    class Settings(WindSettings):
        """Speed and direction."""

        kind: Literal["steady_wind"] = "steady_wind"

    def __init__(self, settings: Settings, plant: Plant, dt_s: float, seed: tuple[int, int]) -> None:
        self._velocity, self.acts = settings.velocity, settings.speed_m_s > 0.0

    def wind(self, k: int) -> Array:
        return self._velocity


class Gust(Disturbance):
    """A 1-cosine gust (the shape of FAR 25.341): w(t) = w/2 (1 - cos(2 pi t / duration)) for one period."""

    class Settings(WindSettings):
        """Speed, direction and time."""

        kind: Literal["gust"] = "gust"
        start_s: Annotated[float, quantity("s", "simulated time", ge=0, le=36000)]
        duration_s: Annotated[float, quantity("s", "length of the gust", gt=0, le=600)]

    def __init__(self, settings: Settings, plant: Plant, dt_s: float, seed: tuple[int, int]) -> None:
        self._velocity, self._dt_s, self.acts = settings.velocity, dt_s, settings.speed_m_s > 0.0
        self._start_s, self._duration_s = settings.start_s, settings.duration_s

    def wind(self, k: int) -> Array:
        since = (k * self._dt_s - self._start_s) / self._duration_s
        if not 0.0 < since < 1.0:
            return STILL_AIR
        velocity: Array = (0.5 - 0.5 * math.cos(2.0 * math.pi * since)) * self._velocity
        return velocity
