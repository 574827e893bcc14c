# SPDX-License-Identifier: Apache-2.0
"""A gust: the air itself moves sideways for a while."""

import math
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.disturbances.protocol import Disturbance
from skydiver_utc.parameters.fields import SlotSettings, quantity
from skydiver_utc.plants.protocol import Plant
from skydiver_utc.rotations import into_body

Array = NDArray[np.float64]


class Gust(Disturbance):
    """A horizontal 1-cosine gust (the shape of FAR 25.341) on a plant whose state is that of a body in the air.

    The plant's velocity becomes that relative to the air, on which its forces depend; the measured one is that over
    ground, so that the controller does not know the wind.
    """

    class Settings(SlotSettings):
        """Wind w(t) = w/2 (1 - cos(2 pi t / duration)) from the start on, for one period."""

        kind: Literal["gust"] = "gust"
        speed_m_s: Annotated[float, quantity("m/s", "largest speed of the wind", ge=0, le=50)]
        to_deg: Annotated[
            float, quantity("deg", "where the wind blows to, counter-clockwise from east", ge=-360, le=360)
        ] = 90.0
        start_s: Annotated[float, quantity("s", "simulated time", ge=0, le=36000)]
        duration_s: Annotated[float, quantity("s", "length of the gust", gt=0, le=600)]

    def __init__(self, settings: Settings, plant: Plant, dt_s: float, seed: tuple[int, int]) -> None:
        if plant.state_message != "odometry":
            raise ValueError(
                "the plant's state has no velocity in the air: take the gust out, or fly a skydiver"
            )
        self._settings, self._dt_s = settings, dt_s
        angle = math.radians(settings.to_deg)
        self._direction = np.array([math.cos(angle), math.sin(angle), 0.0])

    def state(self, k: int, state: Array) -> Array:
        """The velocity changed by as much as the wind has changed; the wind takes the body along."""
        disturbed = state.copy()
        disturbed[:3] += self._dt_s * self._wind(k)
        disturbed[7:10] -= into_body(state[3:7], self._wind(k) - self._wind(k - 1))
        return disturbed

    def measurement(self, k: int, state: Array) -> Array:
        """The velocity over ground."""
        measured = state.copy()
        measured[7:10] += into_body(state[3:7], self._wind(k))
        return measured

    def _wind(self, k: int) -> Array:
        """Velocity of the air (3,) in the world at step k [m/s]."""
        since = (k * self._dt_s - self._settings.start_s) / self._settings.duration_s
        share = 0.5 - 0.5 * math.cos(2.0 * math.pi * min(max(since, 0.0), 1.0))
        wind: Array = self._settings.speed_m_s * share * self._direction
        return wind
