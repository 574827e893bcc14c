# SPDX-License-Identifier: Apache-2.0
"""All disturbances of a run as one."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.disturbances.air import in_moving_air
from skydiver_utc.disturbances.protocol import STILL_AIR, Disturbance
from skydiver_utc.parameters import ParameterError
from skydiver_utc.plants.protocol import Plant


class Composed(Disturbance):
    """Winds add up; changes of state and measurement follow one another in the order of the scenario.

    In moving air the state's velocity is that relative to the air, on which the forces depend, and its place is
    carried along; the measured velocity is that over ground, so that the controller does not know the wind.
    """

    def __init__(self, parts: Sequence[Disturbance], plant: Plant, dt_s: float) -> None:
        self.parts, self._dt_s = parts, dt_s
        winds, self._winds = _methods(parts, "wind")
        _, self._states = _methods(parts, "state")
        measurements, self._measurements = _methods(parts, "measurement")
        self.changes_measurements = bool(measurements)
        self._step, self._wind = -1, STILL_AIR
        # Newest step, its state over ground, what is measured.
        self._measured: tuple[int, Array, Array] | None = None
        self.names: tuple[str, ...] = ("wind_x", "wind_y", "wind_z") if winds else ()
        if measurements:
            self.names += tuple(f"error_{name}" for name in plant.state_names)
        if winds and plant.state_message != "odometry":
            raise ParameterError(
                "the plant's state has no velocity in the air: take the wind out, or fly a skydiver"
            )

    def wind(self, k: int) -> Array:
        if self._winds and k != self._step:
            found, *others = (wind(k) for wind in self._winds)
            for other in others:
                found = found + other
            self._step, self._wind = k, found if found is STILL_AIR else np.array(found, dtype=float)
        return self._wind

    def state(self, k: int, state: Array) -> Array:
        for disturbed in self._states:
            state = disturbed(k, state)
        if self._winds:
            before = self.wind(k - 1)
            state = in_moving_air(state, self.wind(k), before, self._dt_s)
        return state

    def measurement(self, k: int, state: Array) -> Array:
        if not self.changes_measurements:
            return self.over_ground(k, state)
        if self._measured is not None and self._measured[0] == k:
            return self._measured[2]
        over_ground = state = self.over_ground(k, state)
        for measured in self._measurements:
            state = measured(k, state)
        self._measured = (k, over_ground, state)
        return state

    def over_ground(self, k: int, state: Array) -> Array:
        """The plant's state (n,) at step k with its velocity over ground."""
        return in_moving_air(state, STILL_AIR, self.wind(k), 0.0) if self._winds else state

    def acted(self, k: int, state: Array) -> Array:
        """By `names`: the wind [m/s] and the error of what is measured at a state (n,) of step k."""
        if not self.changes_measurements:
            return self.wind(k)[: len(self.names)]
        measured = self.measurement(k, state)
        assert self._measured is not None
        error: Array = measured - self._measured[1]
        return np.concatenate((self.wind(k), error)) if len(self.names) > len(error) else error

    def reset(self) -> None:
        self._measured = None
        for part in self.parts:
            part.reset()


def _methods(parts: Sequence[Disturbance], name: str) -> tuple[list[Disturbance], list[Any]]:
    """The parts whose class has a method of its own of this name, and that method of each part that acts."""
    found = [part for part in parts if getattr(type(part), name) is not getattr(Disturbance, name)]
    return found, [getattr(part, name) for part in found if getattr(part, "acts", True)]
