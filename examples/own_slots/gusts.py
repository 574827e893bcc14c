# SPDX-License-Identifier: Apache-2.0
"""A disturbance of one's own: gusts that turn the body, now and then."""

from typing import Annotated

import numpy as np

from skydiver_utc import Disturbance, Plant, SlotSettings, quantity


class Gusts(Disturbance):
    """Sudden changes of the last three states, the body rates, at random times."""

    class Settings(SlotSettings):
        """How often, and how hard."""

        per_s: Annotated[float, quantity("1/s", "mean number of gusts each second", ge=0)] = 1.0
        size_deg_s: Annotated[float, quantity("deg/s", "standard deviation of each rate's change", ge=0)] = (
            10.0
        )

    def __init__(self, settings: Settings, plant: Plant, dt_s: float, seed: tuple[int, int]) -> None:
        self._seed = seed
        self._share, self._size = settings.per_s * dt_s, np.deg2rad(settings.size_deg_s)

    def state(self, k: int, state: np.ndarray) -> np.ndarray:
        """The state (n,) at step k, after a gust if there is one."""
        random = np.random.default_rng((*self._seed, k))  # the same bits for a step, in process and over ROS
        if random.random() >= self._share:
            return state
        return state + np.append(np.zeros(len(state) - 3), self._size * random.normal(size=3))
