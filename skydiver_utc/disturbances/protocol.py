# SPDX-License-Identifier: Apache-2.0
"""The interface of a disturbance to the closed loop."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Disturbance(Protocol):
    """An influence on a run besides the controls; made as `Class(settings, plant, dt_s, seed)`.

    A class that inherits from this one writes only the method that it needs.
    """

    def state(self, k: int, state: Array) -> Array:
        """The plant's state (n,) at step k, disturbed."""
        return state

    def measurement(self, k: int, state: Array) -> Array:
        """The measured state (n,) at step k."""
        return state
