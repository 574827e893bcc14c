# SPDX-License-Identifier: Apache-2.0
"""Noise, bias and drift of the measured state."""

from collections.abc import Iterator, Mapping
from typing import Annotated, Literal

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.disturbances.protocol import Disturbance
from skydiver_utc.disturbances.rows import BLOCK, Rows
from skydiver_utc.parameters.fields import SlotSettings, quantity
from skydiver_utc.plants.protocol import Plant
from skydiver_utc.rotations import turned

Deviation = Annotated[float, quantity("1", "standard deviation, in the unit of the state or group", ge=0)]
Value = Annotated[float, quantity("1", "value, in the unit of the state or group")]

# Of a state that is an Odometry: first place in it, and the factor to its unit; of the attitude a turn about body axes.
_GROUPS = {
    "position_m": (0, 1.0),
    "attitude_deg": (3, float(np.deg2rad(1.0))),
    "velocity_m_s": (7, 1.0),
    "rates_deg_s": (10, float(np.deg2rad(1.0))),
}
_ATTITUDE, _TURN = slice(3, 7), slice(3, 6)


class MeasurementError(Disturbance):
    """Noise, a bias and a random walk added to the measured state, each by state or by group of states."""

    class Settings(SlotSettings):
        """Names of states in their units, or of an Odometry's groups of three; what is left out has no error."""

        kind: Literal["measurement_error"] = "measurement_error"
        noise: dict[str, Deviation] = {}
        bias: dict[str, Value] = {}
        drift: Annotated[
            dict[str, Deviation], quantity("1/sqrt(s)", "standard deviation of the walk after 1 s")
        ] = {}

    def __init__(self, settings: Settings, plant: Plant, dt_s: float, seed: tuple[int, int]) -> None:
        self._noise, self._bias = _by_state(settings.noise, plant), _by_state(settings.bias, plant)
        self._walk = np.sqrt(dt_s) * _by_state(settings.drift, plant)
        given = np.abs(self._bias) + self._noise + self._walk
        self.acts = bool(given.any())
        self._turns = plant.state_message == "odometry" and bool(given[_ATTITUDE].any())
        self._seed = seed
        self._rows = Rows(self._blocks)

    def measurement(self, k: int, state: Array) -> Array:
        error = self._rows[k]
        measured: Array = state + error
        if self._turns:
            turned(state[_ATTITUDE], error[_TURN], measured[_ATTITUDE])
        return measured

    def _blocks(self) -> Iterator[Array]:
        random, n = np.random.default_rng(self._seed), len(self._noise)
        walked = np.zeros(n)
        while True:
            noise, steps = random.standard_normal((2, BLOCK, n))
            walks = walked + np.cumsum(self._walk * steps, axis=0)
            error = self._bias + self._noise * noise + np.vstack((walked, walks[:-1]))
            walked = walks[-1]
            yield error


def _by_state(given: Mapping[str, float], plant: Plant) -> Array:
    """A number for each state (n,), its own rather than its group's; an attitude's first three are turns [rad]."""
    values = np.zeros(len(plant.state_names))
    odometry = plant.state_message == "odometry"
    names = [name for i, name in enumerate(plant.state_names) if not (odometry and 3 <= i < 7)]
    for name, value in sorted(given.items(), key=lambda item: item[0] not in _GROUPS):
        if odometry and name in _GROUPS:
            first, factor = _GROUPS[name]
            values[first : first + 3] = factor * value
        elif name in names:
            values[plant.state_names.index(name)] = value
        else:
            known = [*names, *(_GROUPS if odometry else ())]
            raise ValueError(f"there is no state {name}: choose from {', '.join(known)}")
    return values
