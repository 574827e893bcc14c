# SPDX-License-Identifier: Apache-2.0
"""Bounds and rates of a control vector, as controllers keep them."""

import math

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.jit import unfused
from skydiver_utc.plants.protocol import Plant

Array = NDArray[np.float64]


def limits_of(plant: Plant) -> Array:
    """Limits (3, m) of a plant's control: minimum, maximum and largest change in one step."""
    return np.array([plant.minimum, plant.maximum, plant.rate * plant.dt_s])


def all_finite(values: Array) -> bool:
    """Whether a few numbers (n,) are finite; `np.isfinite(values).all()` costs several times as much."""
    return all(map(math.isfinite, values.tolist()))


@unfused
def limited(wanted: Array, previous: Array, limits: Array) -> Array:
    """A control (m,) inside its bounds, then inside its largest change from the previous one; limits (3, m)."""
    control = np.empty(wanted.shape[0])
    for c in range(control.shape[0]):
        value = min(max(wanted[c], limits[0, c]), limits[1, c])
        control[c] = min(max(value, previous[c] - limits[2, c]), previous[c] + limits[2, c])
    return control


class LimitedController:
    """A controller whose whole memory is the control applied last (m,), inside the plant's limits (3, m)."""

    def __init__(self, plant: Plant) -> None:
        self._limits, self._initial = limits_of(plant), plant.initial_control()
        self.reset()

    def reset(self) -> None:
        """Start again from the initial control."""
        self.resume(self._initial)

    def resume(self, control: Array) -> None:
        """Start from this control (m,), the one applied last."""
        self._previous = control.copy()
