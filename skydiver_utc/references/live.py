# SPDX-License-Identifier: Apache-2.0
"""A reference received during the run, for example from a stick."""

from typing import Annotated, Literal

import numpy as np
from pydantic import model_validator
from typing_extensions import Self

from skydiver_utc.arrays import Array
from skydiver_utc.parameters.fields import SlotSettings, text

Component = Literal["linear.x", "linear.y", "linear.z", "angular.x", "angular.y", "angular.z"]


class Live:
    """Holds the values received last, and before the first ones the initial values."""

    class Settings(SlotSettings):
        """Which component of a stick's TwistStamped is which output, in the unit of the output."""

        kind: Literal["live"] = "live"
        outputs: Annotated[dict[str, Component], text("component of the twist for each output")]
        initial: Annotated[dict[str, float], text("value of an output before the first message; else 0")] = {}

        @model_validator(mode="after")
        def _check(self) -> Self:
            if not self.outputs:
                raise ValueError("outputs is empty: name at least one, such as yaw_rate: angular.z")
            if unknown := set(self.initial) - set(self.outputs):
                raise ValueError(
                    f"{', '.join(sorted(unknown))} has a value and is not among the outputs: add it"
                )
            return self

    def __init__(self, settings: Settings, dt_s: float) -> None:
        self.outputs = tuple(settings.outputs)
        self.components = tuple(settings.outputs.values())
        self.amplitude: Array = np.zeros(len(self.outputs))
        self._values: Array = np.array([settings.initial.get(name, 0.0) for name in self.outputs])

    def receive(self, values: Array) -> None:
        """Hold these values (l,) from now on."""
        self._values = np.array(values, dtype=np.float64)

    def preview(self, k: int, count: int) -> Array:
        """The values held (count, l)."""
        return np.tile(self._values, (count, 1))
