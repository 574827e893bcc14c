# SPDX-License-Identifier: Apache-2.0
"""No estimation: the controller decides on the true state."""

from typing import Literal

from skydiver_utc.arrays import Array
from skydiver_utc.estimators.protocol import Estimator
from skydiver_utc.parameters.fields import SlotSettings


class TrueState(Estimator):
    """Hands the true state on; see `skydiver_utc.estimators.protocol.Estimator`."""

    class Settings(SlotSettings):
        """The true state, without settings."""

        kind: Literal["true_state"] = "true_state"

    def __init__(self, *_: object) -> None:
        pass

    def update(self, measurement: Array) -> Array:
        return measurement
