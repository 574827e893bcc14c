# SPDX-License-Identifier: Apache-2.0
"""Gusts that users let begin."""

from skydiver_utc.arrays import Array
from skydiver_utc.disturbances.protocol import STILL_AIR, Disturbance
from skydiver_utc.disturbances.wind import Gust
from skydiver_utc.parameters.registry import factory
from skydiver_utc.plants.protocol import Plant


class Gusts(Disturbance):
    """Gusts of a flight as one wind; settings: of the next one, None for a plant on which wind has no effect."""

    def __init__(self, plant: Plant) -> None:
        self._plant, self._blown = plant, list[Disturbance]()
        self.settings: Gust.Settings | None = None
        if plant.state_message == "odometry":
            # It turns the body by some ten degrees and is over before one loses patience; chosen by eye.
            self.settings = Gust.Settings(speed_m_s=10.0, to_deg=90.0, start_s=0.0, duration_s=2.0)

    def change(self, name: str, value: float) -> None:
        """Another value of a setting of the next gust."""
        assert self.settings is not None
        self.settings = self.settings.replace(**{name: value})

    def blow(self, k: int) -> None:
        """Let a gust begin at step k."""
        assert self.settings is not None
        dt_s = self._plant.dt_s
        gust = factory("disturbance", "gust")(
            self.settings.replace(start_s=k * dt_s), self._plant, dt_s, (0, 0)
        )
        self._blown.append(gust)

    def wind(self, k: int) -> Array:
        """The sum of the gusts (3,) at step k [m/s]."""
        return sum((gust.wind(k) for gust in self._blown), start=STILL_AIR)

    def reset(self) -> None:
        """Still air."""
        self._blown.clear()
