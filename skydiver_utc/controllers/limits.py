# SPDX-License-Identifier: Apache-2.0
"""Control vectors: numbers by name, and bounds and rates as controllers keep them."""

from collections.abc import Mapping

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.jit import kernel
from skydiver_utc.plants.protocol import Plant


def limits_of(plant: Plant) -> Array:
    """Limits (3, m) of a plant's control: minimum, maximum and largest change in one step."""
    return np.array([plant.minimum, plant.maximum, plant.rate * plant.dt_s])


def by_name(name: str, given: Mapping[str, float], plant: Plant, default: float | Array) -> Array:
    """Numbers (m,) of a table by the names of the controls. Raises ValueError."""
    if unknown := set(given) - set(plant.control_names):
        raise ValueError(f"{name}.{unknown.pop()}: the plant has {', '.join(plant.control_names)}")
    values = np.broadcast_to(default, len(plant.control_names)).astype(float)
    for c, control in enumerate(plant.control_names):
        values[c] = given.get(control, values[c])
    return values


@kernel
def limit(wanted: Array, limits: Array, control: Array) -> None:
    """Move a control (m,) to a wanted one, inside its bounds, then inside its largest change; limits (3, m)."""
    for c in range(control.shape[0]):
        value, before = min(max(wanted[c], limits[0, c]), limits[1, c]), control[c]
        control[c] = min(max(value, before - limits[2, c]), before + limits[2, c])


def limited(wanted: Array, previous: Array, limits: Array) -> Array:
    """A control (m,) inside its bounds, then inside its largest change from the previous one; limits (3, m)."""
    control = previous.copy()
    limit(wanted, limits, control)
    return control


class LimitedController:
    """A controller whose whole memory is the control applied last (m,), inside the plant's limits (3, m)."""

    def __init__(self, plant: Plant) -> None:
        self._limits, self._initial = limits_of(plant), plant.initial_control()
        self._previous = np.array(self._initial, dtype=float)

    def reset(self) -> None:
        """Start again from the initial control."""
        self.resume(self._initial)

    def resume(self, control: Array) -> None:
        """Start from this control (m,), the one applied last."""
        self._previous[:] = control
