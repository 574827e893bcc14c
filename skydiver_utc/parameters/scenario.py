# SPDX-License-Identifier: Apache-2.0
"""One scenario: everything a run needs."""

import math
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import ConfigDict, SerializeAsAny, model_validator
from typing_extensions import Self

from skydiver_utc.parameters.fields import Parameters, SlotSettings, quantity, text
from skydiver_utc.parameters.nanoseconds import NANOSECONDS
from skydiver_utc.parameters.registry import settings_class

# The slots that have one block each in a scenario.
SLOTS = ("plant", "reference", "controller", "estimator")


class Truth(Parameters):
    """The plant of the run where it is not the plant with which controller and estimator predict.

    Beside the fields below any setting of the plant's block, with another value.
    """

    model_config = ConfigDict(extra="allow")

    actuator_lag_s: Annotated[
        float, quantity("s", "time constant of a first-order lag between command and limits", ge=0, le=10)
    ] = 0.0


def laid_over(plant: Mapping[str, Any], truth: Mapping[str, Any]) -> dict[str, Any]:
    """The block of the plant of the run, plain data; a truth of another kind stands for itself."""
    changes = {field: value for field, value in truth.items() if field not in Truth.model_fields}
    return merged({"plant": plant}, {"plant": changes})["plant"]


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
    truth: Annotated[Truth, text("the plant of the run where it is not that of the controller's model")] = (
        Truth()
    )

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
    def true_plant(self) -> Any:
        """Settings of the plant of the run: those of `plant` with the values of `truth` laid over them."""
        if not self.truth.model_extra:
            return self.plant
        content = laid_over(self.plant.as_dict(), self.truth.as_dict())
        return settings_class("plant", content["kind"]).model_validate(content)

    @property
    def has_estimator(self) -> bool:
        """True where the controller decides on an estimate, which over ROS a node of its own publishes."""
        return bool(self.estimator.kind != "true_state")

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


def merged(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    """Fields of `over` laid over those of `base`, block by block."""
    result = dict(base)
    for key, value in over.items():
        old = result.get(key)
        if isinstance(old, dict) and isinstance(value, dict):
            # A block of another kind (a sine for a constant) or with a name (a posture) replaces the old one whole.
            whole = "name" in value or value.get("kind", old.get("kind")) != old.get("kind")
            result[key] = value if whole else merged(old, value)
        else:
            result[key] = value
    return result
