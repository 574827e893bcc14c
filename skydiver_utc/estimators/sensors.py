# SPDX-License-Identifier: Apache-2.0
"""The plant's side of the sensors: true values with noise, bias, drift, delay and loss."""

import math
from collections import deque
from collections.abc import Callable, Mapping

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.estimators.protocol import Reading
from skydiver_utc.estimators.sensor_models import SensorOfPlant, sensors_of
from skydiver_utc.estimators.settings import SensorSettings
from skydiver_utc.jit import by_address, in_memory, is_jitted
from skydiver_utc.plants.protocol import Plant


class Sensors:
    """All sensors of a plant, by index as in `models`.

    Their errors depend on the seed, a sensor's name and the number of its measurement alone.
    """

    def __init__(self, given: Mapping[str, SensorSettings], plant: Plant, dt_s: float, seed: int) -> None:
        self.models = sensors_of(given, plant, dt_s)
        control = plant.step_control(plant.initial_applied(), plant.initial_applied())
        self._sensors = [
            _Sensor(i, sensor, plant, control, dt_s, seed) for i, sensor in enumerate(self.models)
        ]

    def reset(self) -> None:
        """Before step 0."""
        for sensor in self._sensors:
            sensor.reset()

    def arrivals(self, k: int) -> list[tuple[int, int]]:
        """Sensor and step of the measurements that arrive at step k; called instead of `read`, for each step once."""
        return [(reading.sensor, reading.step) for sensor in self._sensors for reading in sensor.read(k)]

    def read(self, k: int, state: Array, over_ground: Array, control: Array) -> list[Reading]:
        """The measurements that arrive at step k; called for each step once, from 0 on.

        state, over_ground (n,): that of the step, its velocity relative to the air and over ground
        control (c,): of the step that led there, as the model takes it
        """
        return [
            reading
            for sensor in self._sensors
            for reading in sensor.read(k, state if sensor.in_air else over_ground, control)
        ]


class _Sensor:
    def __init__(
        self, index: int, sensor: SensorOfPlant, plant: Plant, control: Array, dt_s: float, seed: int
    ) -> None:
        self._index, self._sensor, self._dt_s = index, sensor, dt_s
        self._measure = _measurement(sensor, plant, control)
        self.in_air = sensor.own is not None and sensor.own.in_air
        self._seed = [seed, *sensor.name.encode()]
        # Rounded first: a delay of whole steps takes so many.
        self._delay_steps = math.ceil(round(sensor.settings.delay_s / dt_s, 6))
        self._walk = sensor.settings.drift / math.sqrt(sensor.settings.rate_Hz)
        self.reset()

    def reset(self) -> None:
        self._rng = np.random.default_rng(self._seed)
        self._bias = self._sensor.bias.copy()
        self._taken, self._due, self._under_way = 0, 0.0, deque[Reading]()

    def read(self, k: int, state: Array | None = None, control: Array | None = None) -> list[Reading]:
        if k >= self._due:
            settings = self._sensor.settings
            noise, walk = self._rng.standard_normal((2, self._sensor.size))
            lost = self._rng.random() < settings.loss
            values = np.full(self._sensor.size, np.nan)
            if state is not None and control is not None:
                self._measure(state, control, values)
            values += self._bias + settings.noise * noise
            self._bias += self._walk * walk
            self._taken += 1
            self._due = self._taken / (settings.rate_Hz * self._dt_s) - 1e-6
            if not lost:
                self._under_way.append(Reading(self._index, k, values))
        arrived = []
        while self._under_way and self._under_way[0].step + self._delay_steps <= k:
            arrived.append(self._under_way.popleft())
        return arrived


def _measurement(
    sensor: SensorOfPlant, plant: Plant, control: Array
) -> Callable[[Array, Array, Array], None]:
    """The values of a sensor without errors: (state, control, out)."""
    own = sensor.own
    if own is None:

        def select(state: Array, _: Array, out: Array) -> None:
            out[:] = np.concatenate([state, plant.outputs(state)])[sensor.selected]

        return select
    if not is_jitted(own.function):
        return lambda state, control, out: own.function(state, control, own.numbers, out)
    example = plant.initial_state(), control, np.empty(sensor.size)
    return by_address([(in_memory(own.function), own.numbers)], *example)
