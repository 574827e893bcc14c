# SPDX-License-Identifier: Apache-2.0
"""The unscented Kalman filter, the dual of UTC: sigma points of the state instead of the control."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.estimators.filter_steps import Correction, Estimate, Prediction, correct, predict
from skydiver_utc.estimators.manifold import attitude_of, error_names
from skydiver_utc.estimators.protocol import Estimator, Reading
from skydiver_utc.estimators.sensor_models import SensorOfPlant, sensors_of
from skydiver_utc.estimators.settings import UnscentedKalmanFilterSettings
from skydiver_utc.jit import InMemory, address, by_address, in_memory, interpreted, is_jitted
from skydiver_utc.plants.protocol import Plant
from skydiver_utc.unscented.sigma_points import weights


class UnscentedKalmanFilter(Estimator):
    """Estimates the plant's state (n,) and, where wanted, biases of sensors; for one thread.

    A measurement that comes late is filtered again from its own step on, as if it had come in time; one older than
    the history is left out.

    Telemetry: `estimate_<state>` and `bias_<sensor>_<number>`, `deviation_<...>` of both (of an attitude about the
    body's axes), and for each sensor `nis_<sensor>`, the normalised innovation squared of the measurement that arrived
    at this step, and `innovation_<sensor>_<number>`, its uncorrelated parts in units of their standard deviation; NaN
    without one.
    """

    Settings = UnscentedKalmanFilterSettings

    def __init__(self, settings: UnscentedKalmanFilterSettings, plant: Plant, dt_s: float) -> None:
        self._plant = plant
        self._sensors = sensors_of(settings.sensors, plant, dt_s)
        biased = [s for s in self._sensors if s.settings.bias_deviation > 0.0]
        biases = tuple(f"bias_{s.name}_{name}" for s in biased for name in s.names)
        names = plant.state_names + biases
        errors = error_names(names)
        if unknown := [a for a in settings.angles if a not in (*plant.state_names, *plant.output_names)]:
            raise ValueError(f"angles: the plant has no state or output {unknown[0]}")
        e, steps = len(errors), math.ceil(round(settings.history_s / dt_s, 6)) + 1
        initial = _by_name("initial_deviation", settings.initial_deviation, errors)
        walk = _by_name("process_noise", settings.process_noise, errors)
        for sensor in biased:
            at = errors.index(f"bias_{sensor.name}_{sensor.names[0]}")
            initial[at : at + sensor.size] = sensor.settings.bias_deviation
            walk[at : at + sensor.size] = sensor.settings.drift
        self._initial = np.diag(initial**2)
        self._at = Estimate(
            mean=np.zeros(len(names)),
            P=np.empty((e, e)),
            attitude=attitude_of(names),
            angles=np.array([errors.index(a) for a in settings.angles if a in errors], dtype=np.int64),
            weights=weights(e, settings.W0),
            W0=settings.W0,
            points=np.empty((2 * e + 1, len(names))),
            errors=np.empty((2 * e + 1, e)),
            root=np.empty((e, e)),
            vectors=np.empty((e + 1, e)),
            shift=np.empty(e),
            nothing=np.zeros(e),
        )
        control = plant.step_control(plant.initial_applied(), plant.initial_applied())
        model, state = plant.model, np.empty(plant.model.state_size)
        Q = np.diag(walk**2 * dt_s)
        self._predict = _program(
            predict, model.step, model.parameters, (state, control), (state,),
            lambda f, p: Prediction(self._at, f, p, state, Q), (control, np.empty(1)),
        )  # fmt: skip
        self._correct = [
            self._correction(sensor, names, settings.angles, control) for sensor in self._sensors
        ]
        # The history, by step modulo its length: before the measurements of that step.
        self._means, self._covariances = np.empty((steps, len(names))), np.empty((steps, e, e))
        self._controls = np.empty((steps, len(control)))
        self._readings: list[list[Reading]] = [[] for _ in range(steps)]
        innovations = [
            (f"nis_{s.name}", *(f"innovation_{s.name}_{n}" for n in s.names)) for s in self._sensors
        ]
        self._place = np.cumsum([0, *map(len, innovations)]) + len(names) + e
        self.telemetry_names = (
            *(name if name.startswith("bias_") else f"estimate_{name}" for name in names),
            *(f"deviation_{name}" for name in errors),
            *(name for of_sensor in innovations for name in of_sensor),
        )
        self.reset()

    @property
    def covariance(self) -> Array:
        """Covariance (e, e) of the error, in the order of the telemetry's deviations."""
        return self._at.P.copy()

    def reset(self) -> None:
        """Begin at the step of the next update, from the plant's initial state."""
        n = self._plant.model.state_size
        self.left_out = 0  # measurements older than the history
        self.step, self._is_new = 0, True
        self._at.mean[:n], self._at.mean[n:] = self._plant.initial_state(), 0.0
        self._at.P[:] = self._initial
        self._applied = np.array(self._plant.initial_applied(), dtype=float)
        for readings in self._readings:
            readings.clear()
        self.telemetry = np.full(len(self.telemetry_names), np.nan)

    def predict(self, applied: Array) -> None:
        control = np.ascontiguousarray(self._plant.step_control(self._applied, applied), dtype=float)
        self._applied = np.array(applied, dtype=float)
        self._k += 1
        self._readings[self._k % len(self._readings)].clear()
        self._step(control)

    def update(self, measurement: Any) -> Array:
        if self._is_new:
            self._k, self._first, self._is_new = self.step, self.step, False
            self._keep(self._plant.step_control(self._applied, self._applied))
        length, new = len(self._readings), set[tuple[int, int]]()
        oldest = self._k
        for reading in measurement:
            if not max(self._first, self._k - length + 1) <= reading.step <= self._k:
                self.left_out += 1
                continue
            of_step = self._readings[reading.step % length]
            if any(known.sensor == reading.sensor for known in of_step):
                continue  # published again
            of_step.append(reading)
            of_step.sort(key=lambda r: r.sensor)
            new.add((reading.sensor, reading.step))
            oldest = min(oldest, reading.step)
        self.telemetry[:] = np.nan
        if new:
            row, last, self._k = oldest % length, self._k, oldest
            self._at.mean[:], self._at.P[:] = self._means[row], self._covariances[row]
            self._take_in(new)
            while self._k < last:
                self._k += 1
                self._step(self._controls[self._k % length])
                self._take_in(new)
        n, e = len(self._at.mean), len(self._at.P)
        self.telemetry[:n] = self._at.mean
        self.telemetry[n : n + e] = np.sqrt(np.maximum(self._at.P.diagonal(), 0.0))
        return self._at.mean[: self._plant.model.state_size].copy()

    def _step(self, control: Array) -> None:
        self._predict(control, np.empty(1))
        self._keep(control)

    def _keep(self, control: Array) -> None:
        row = self._k % len(self._readings)
        self._means[row], self._covariances[row], self._controls[row] = self._at.mean, self._at.P, control

    def _take_in(self, new: set[tuple[int, int]]) -> None:
        """Correct by the readings of a step; what comes of new ones goes to the telemetry."""
        row = self._k % len(self._readings)
        for reading in self._readings[row]:
            first, end = self._place[reading.sensor : reading.sensor + 2]
            is_new = (reading.sensor, reading.step) in new
            out = self.telemetry[first:end] if is_new else np.empty(end - first)
            self._correct[reading.sensor](reading.values, self._controls[row], out)

    def _correction(
        self, sensor: SensorOfPlant, names: tuple[str, ...], angles: Sequence[str], control: Array
    ) -> Callable[..., None]:
        model, own, l = self._plant.model, sensor.own, sensor.size
        state, named = np.empty(model.state_size), np.empty(len(self._plant.output_names))
        points, e = len(self._at.points), len(self._at.P)
        bias = f"bias_{sensor.name}_{sensor.names[0]}"

        def numbers(function: Any, parameters: Any) -> Correction:
            return Correction(
                estimate=self._at,
                own=int(own is not None),
                function=function,
                numbers=parameters,
                selected=sensor.selected,
                state=state,
                named=named,
                variance=np.full(l, sensor.settings.noise**2),
                bias=names.index(bias) if bias in names else -1,
                angles=np.array([k for k, name in enumerate(sensor.names) if name in angles], dtype=np.int64),
                measured=np.empty((points, l)),
                expected=np.empty(l),
                C_y=np.empty((l, l)),
                gain=np.empty((e, l)),
                alive=np.ones(points),
            )

        values, out = np.empty(l), np.empty(1 + l)
        example = (values, control, out)
        if own is not None:
            return _program(correct, own.function, own.numbers, (state, control), (values,), numbers, example)
        return _program(correct, model.outputs, model.parameters, (state,), (named,), numbers, example)


def _program(
    text: Any,
    function: Any,
    parameters: Any,
    given: tuple[Array, ...],
    written: tuple[Array, ...],
    numbers: Callable[[Any, Any], Any],
    example: tuple[Array, ...],
) -> Callable[..., None]:
    """A program of `filter_steps` with a function (*given, parameters, *written), compiled if the function is."""
    if not is_jitted(function):
        in_python, its_numbers = interpreted(text, call=_called), numbers(function, parameters)
        return lambda *arguments: in_python(*arguments[:-1], its_numbers, arguments[-1])
    placed = InMemory(parameters)
    where = address(in_memory(function), *given, placed, *written)
    run: Any = by_address([(text, numbers(where, placed.address))], *example)
    run.kept = (*run.kept, placed, function)
    return run


def _called(function: Any, arguments: tuple[Any, ...]) -> None:
    function(*arguments)


def _by_name(name: str, given: Mapping[str, float], names: tuple[str, ...]) -> Array:
    if unknown := [n for n in given if n not in names]:
        raise ValueError(f"{name}: there is no {unknown[0]} among {', '.join(names)}")
    return np.array([given.get(n, 0.0) for n in names])
