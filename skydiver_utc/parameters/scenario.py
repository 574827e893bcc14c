# SPDX-License-Identifier: Apache-2.0
"""One scenario: everything a run needs."""

import math
from typing import Annotated, Any

from pydantic import SerializeAsAny, model_validator
from typing_extensions import Self

from skydiver_utc.parameters.fields import Parameters, SlotSettings, quantity, text
from skydiver_utc.parameters.nanoseconds import NANOSECONDS

# The slots that have one block each in a scenario.
SLOTS = ("plant", "reference", "controller", "estimator")


class Scenario(Parameters):
    """A run, resolved: no names of other files are left in it.

    plant, reference, controller, estimator, disturbances: settings of the kind that stands in each slot
    """

    name: str
    title: str = ""
    description: str = ""
    duration_s: Annotated[float, quantity("s", "simulated time of the run", gt=0, le=36000)]
    dt_s: Annotated[float, quantity("s", "control and integration step", ge=1e-4, le=1.0)]
    # 2026-01-01T00:00:00Z: simulated time starts away from zero, or viewers show 1970.
    epoch_s: Annotated[int, quantity("s", "simulated time of step 0, Unix time", gt=0, le=4102444800)] = (
        1767225600
    )
    seed: Annotated[int, quantity("1", "seed of every random draw", ge=0, le=2**32 - 1)] = 0
    plant: Annotated[Any, text("the plant")]
    reference: Annotated[Any, text("what the plant's outputs are to be")]
    controller: Annotated[Any, text("the controller")]
    estimator: Annotated[Any, text("where the controller's state comes from")]
    disturbances: Annotated[tuple[SerializeAsAny[SlotSettings], ...], text("what disturbs the plant")] = ()

    @model_validator(mode="after")
    def _check(self) -> Self:
        for name in SLOTS:
            if not isinstance(getattr(self, name), SlotSettings):
                raise ValueError(
                    f"{name} must be the settings of a kind: give one, or use `override` with plain data"
                )
        if abs(self.dt_s * NANOSECONDS - self.dt_ns) > 1e-3:
            raise ValueError(f"dt_s must be a whole number of nanoseconds, it is {self.dt_s}")
        if self.duration_s < self.dt_s:
            raise ValueError(f"duration_s ({self.duration_s}) must be at least one dt_s ({self.dt_s})")
        return self

    @property
    def dt_ns(self) -> int:
        """The step in integer nanoseconds."""
        return round(self.dt_s * NANOSECONDS)

    @property
    def steps(self) -> int:
        """Number of control steps K, the smallest that covers the duration."""
        return math.ceil(round(self.duration_s * NANOSECONDS) / self.dt_ns)

    def stamp_ns(self, k: int) -> int:
        """Simulated time of step k in integer nanoseconds."""
        return self.epoch_s * NANOSECONDS + k * self.dt_ns
