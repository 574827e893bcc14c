# SPDX-License-Identifier: Apache-2.0
"""The interface of a disturbance to the closed loop."""

from typing import Protocol

import numpy as np

from skydiver_utc.arrays import Array

STILL_AIR = np.zeros(3)


class Disturbance(Protocol):
    """An influence on a run besides the controls; made as `Class(settings, plant, dt_s, seed)`.

    A class that inherits from this one writes only the methods that it needs. Steps come in rising order, some may be
    left out and some may come twice: what is random depends on seed and step alone (`Rows`).
    acts: False for settings without effect, such as a wind of 0 m/s; its methods are not called then
    """

    acts: bool = True

    def wind(self, k: int) -> Array:
        """Velocity of the air (3,) in the world at step k [m/s]; the winds of all disturbances add up."""
        return STILL_AIR

    def state(self, k: int, state: Array) -> Array:
        """The plant's state (n,) at step k, disturbed."""
        return state

    def measurement(self, k: int, state: Array) -> Array:
        """The measured state (n,) at step k."""
        return state

    def reset(self) -> None:
        """Forget the run so far."""
