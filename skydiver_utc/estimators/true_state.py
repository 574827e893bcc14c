# SPDX-License-Identifier: Apache-2.0
"""No estimation: the controller decides on the true state."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.estimators.protocol import Estimator
from skydiver_utc.parameters.fields import SlotSettings

Array = NDArray[np.float64]


class TrueState(Estimator):
    """Hands the true state on; see `skydiver_utc.estimators.protocol.Estimator`."""

    class Settings(SlotSettings):
        """The true state, without settings."""

        kind: Literal["true_state"] = "true_state"

    def __init__(self, *_: object) -> None:
        pass

    def update(self, measurement: Array) -> Array:
        """The state (n,) itself."""
        return measurement
