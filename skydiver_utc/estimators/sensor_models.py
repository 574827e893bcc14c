# SPDX-License-Identifier: Apache-2.0
"""The sensors of a scenario on a plant: the plant's own, or its states and outputs by name."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from skydiver_utc.arrays import Array, Integers
from skydiver_utc.estimators.settings import SensorSettings
from skydiver_utc.plants.protocol import Plant, SensorModel


class SensorOfPlant(NamedTuple):
    """A sensor with its settings.

    own: the plant's model of it, or None; selected: else the indices (l,) among states, then outputs
    names, unit: of the l numbers; bias (l,)
    """

    name: str
    settings: SensorSettings
    own: SensorModel | None
    selected: Integers
    names: tuple[str, ...]
    unit: str
    bias: Array

    @property
    def message(self) -> str:
        """Type of its ROS message."""
        return self.own.message if self.own else "JointState"

    @property
    def fields(self) -> tuple[str, ...]:
        """Where its numbers stand in the message; none in a JointState, where they have names."""
        return self.own.fields if self.own else ()

    @property
    def size(self) -> int:
        """Count of the numbers of a measurement."""
        return len(self.names)


def sensors_of(given: Mapping[str, SensorSettings], plant: Plant, dt_s: float) -> list[SensorOfPlant]:
    """The sensors in the order of the settings. Raises ValueError for what the plant does not have."""
    known = (*plant.state_names, *plant.output_names)
    found = []
    for name, settings in given.items():
        own = None if settings.of else plant.sensors.get(name)
        unknown = [of for of in settings.of if of not in known]
        if unknown:
            raise ValueError(
                f"sensor {name}: there is no {unknown[0]} among {', '.join(dict.fromkeys(known))}"
            )
        if own is None and not settings.of:
            has = f"has {', '.join(plant.sensors)}" if plant.sensors else "has no sensors of its own"
            raise ValueError(
                f"sensor {name}: the plant {has}; write in `of` which states or outputs it measures"
            )
        if settings.rate_Hz * dt_s > 1.0 + 1e-9:
            raise ValueError(f"sensor {name}: rate_Hz is above one measurement a step, {1.0 / dt_s:g} Hz")
        names = own.names if own else settings.of
        if isinstance(settings.bias, tuple) and len(settings.bias) != len(names):
            raise ValueError(f"sensor {name}: bias must be one number, or {len(names)}: {', '.join(names)}")
        unit = own.unit if own else plant.units.get(names[0], "")
        bias = np.broadcast_to(np.array(settings.bias, dtype=float), len(names)).copy()
        indices = np.array([known.index(of) for of in settings.of], dtype=np.int64)
        found.append(SensorOfPlant(name, settings, own, indices, names, unit, bias))
    return found
