# SPDX-License-Identifier: Apache-2.0
"""The interface of an estimator to the closed loop."""

from typing import Any, NamedTuple, Protocol

import numpy as np

from skydiver_utc.arrays import Array


class Reading(NamedTuple):
    """A measurement (l,) of a sensor, by its index, taken at a step."""

    sensor: int
    step: int
    values: Array


class Estimator(Protocol):
    """The state that a controller decides on; made as `Class(settings, plant, dt_s)`.

    One whose settings have a block `sensors` is given their readings instead of the state. A class that inherits from
    this one writes only what it needs.

    step: the present one, set before each update
    telemetry_names: of the numbers (t,) that `telemetry` holds after each update
    """

    step: int = 0
    telemetry_names: tuple[str, ...] = ()
    telemetry: Array = np.empty(0)

    @property
    def covariance(self) -> Array | None:
        """Of the error of the newest estimate (e, e), an attitude's being a turn about body axes; None: unknown."""
        return None

    def reset(self) -> None:
        """Forget the run so far."""
        return

    def predict(self, applied: Array) -> None:
        """Advance the estimate by one step under what the actuators applied (a,)."""
        return

    def update(self, measurement: Any) -> Array:
        """The estimated state (n,) from the measured state (n,), or from the readings that arrived at this step."""
        ...
