# SPDX-License-Identifier: Apache-2.0
"""Names and units of a plant's signals as people read them: angles in degrees."""

from typing import NamedTuple

import numpy as np

from skydiver_utc.plants.protocol import Plant


class Shown(NamedTuple):
    """Presentation of a signal: its name in words, its unit, and the factor from the plant's own unit."""

    name: str
    unit: str
    factor: float

    @property
    def label(self) -> str:
        """Name and unit, as on an axis."""
        return f"{self.name} [{self.unit}]"


def in_degrees(unit: str) -> tuple[str, float]:
    """Radians (per second) as degrees: the unit shown, and the factor to it; other units as they are."""
    return ("deg" + unit[3:], float(np.rad2deg(1.0))) if unit.split("/")[0] == "rad" else (unit, 1.0)


def shown(plant: Plant, name: str, degrees: bool = True) -> Shown:
    """Presentation of an output or a control of the plant; without `degrees` in its own unit."""
    unit, factor = plant.units.get(name, "1"), 1.0
    if degrees:
        unit, factor = in_degrees(unit)
    return Shown(name.replace("_", " "), unit, factor)


def disturbance_words(name: str) -> str:
    """What one of `Run.disturbance_names` is."""
    words = {"wind": "wind", "push": "pushed by", "error": "measured less true state"}
    return words[name.partition("_")[0]]


def shown_disturbance(plant: Plant, name: str) -> Shown:
    """Presentation of one of `Run.disturbance_names`: `wind_` and an axis, `error_` or `push_` and a state."""
    kind, _, signal = name.partition("_")
    unit, factor = ("m/s", 1.0) if kind == "wind" else in_degrees(plant.units.get(signal, "1"))
    return Shown(signal.replace("_", " "), unit, factor)
