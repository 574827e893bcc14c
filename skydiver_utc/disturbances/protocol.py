# SPDX-License-Identifier: Apache-2.0
"""What every disturbance offers to the closed loop."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Disturbance(Protocol):
    """What acts on a run besides the controls; made as `Class(settings, plant, dt_s, seed)`.

    A class that inherits from this one writes only the method that it needs.
    """

    def state(self, k: int, state: Array) -> Array:
        """The plant's state (n,) at step k, disturbed."""
        return state

    def measurement(self, k: int, state: Array) -> Array:
        """What is measured (n,) of the state at step k."""
        return state
