# SPDX-License-Identifier: Apache-2.0
"""The interface of an estimator to the closed loop."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Estimator(Protocol):
    """The state that a controller decides on; made as `Class(settings, plant, dt_s)`."""

    def reset(self) -> None:
        """Forget the run so far."""

    def predict(self, applied: Array) -> None:
        """Advance the estimate by one step under what the actuators applied (a,)."""

    def update(self, measurement: Array) -> Array:
        """The estimated state (n,) from what was measured at this step."""
        ...
