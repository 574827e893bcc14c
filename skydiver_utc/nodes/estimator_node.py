# SPDX-License-Identifier: Apache-2.0
"""The estimator as a node: an estimate of each state, from the measurements of sensors and the commands."""

from collections import deque
from functools import partial
from typing import Any

import numpy as np
from rclpy.subscription import Subscription

from skydiver_utc.arrays import Array
from skydiver_utc.estimators.consistency import JUDGEMENT, VERDICTS, Consistency, consistency
from skydiver_utc.estimators.protocol import Reading
from skydiver_utc.estimators.sensor_models import SensorOfPlant
from skydiver_utc.loop.build import build_estimator, build_sensors
from skydiver_utc.loop.estimation import Estimation
from skydiver_utc.messages import read_fields, read_named, read_state
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.answering import AnsweringNode
from skydiver_utc.nodes.diagnostics import Health, Level
from skydiver_utc.nodes.lifecycle import NotNeededError
from skydiver_utc.nodes.stamped_topic import StampedTopic, state_topic
from skydiver_utc.rotations import turn_into_body

_RECENT = 200  # measurements of each sensor, by which the estimate is judged


class EstimatorNode(AnsweringNode):
    """Publishes an estimate for each step of the clock; begins when the controller is subscribed to it.

    In lockstep it takes the measurements that arrive at the step and the command of the step before, and waits for
    them; in real time those that have arrived and the newest command. An estimator without sensors subscribes to
    `state`.
    """

    KIND = topics.ESTIMATOR
    MAIN = topics.ESTIMATE

    def build(self) -> None:
        if not self.scenario.has_estimator:
            raise NotNeededError(f"the scenario {self.scenario.name} has no estimator")
        super().build()
        estimator = build_estimator(self.scenario, self.plant)
        self._estimation = Estimation(estimator, self.plant, self.disturbance)
        self._sensors = build_sensors(self.scenario, self.plant)
        self._models = self._sensors.models if self._sensors else []
        self._readings: dict[tuple[int, int], Reading] = {}  # not used yet, by sensor and step
        self._recent = [deque[Array](maxlen=_RECENT) for _ in self._models]  # innovations
        consistency(np.ones((_RECENT, 1)))  # imports SciPy before the run
        self.out = state_topic(self, topics.ESTIMATE, self.plant)
        judged = (f"{name}_{sensor.name}" for sensor in self._models for name in JUDGEMENT)
        names = (*estimator.telemetry_names, *judged)
        self._telemetry = StampedTopic(self, topics.ESTIMATOR_TELEMETRY, names)
        self.subscribe(topics.COMMAND, self.on_command, self.newest)

    def begin_run(self) -> None:
        self.is_first, self._due_at = True, -1
        self._commanded, self._command = -1, self.plant.initial_control()
        self._estimation.begin()
        if self._sensors is not None:
            self._sensors.reset()
        # Those of step 0 may come before its clock.
        self._readings = {key: reading for key, reading in self._readings.items() if reading.step == 0}
        for innovations in self._recent:
            innovations.clear()
        self._judged = [consistency(np.empty((0, sensor.size))) for sensor in self._models]

    def subscribe_to_inputs(self) -> list[Subscription]:
        """To the measurements last: a plant that has matched these has matched the clock, too."""
        if self._sensors is None:
            return [self.subscribe(topics.STATE.of_plant(self.plant), self.on_state, self.newest)]
        inputs = [self.subscribe(topics.CLOCK, self.on_clock, self.newest)]
        each = None if self.lockstep else topics.EACH_AS_IT_COMES
        for i, sensor in enumerate(self._models):
            topic = topics.sensor_topic(sensor.name, sensor.message)
            inputs.append(self.subscribe(topic, partial(self.on_reading, i, sensor), each))
        return inputs

    def receive(self, stamp: Any, given: Any) -> None:
        """Answer a step; for one that is retransmitted while its command is missing repeat the last estimate.

        The controller repeats its command then, or, if it has been started again, decides on the estimate.
        """
        if self.pending is not None and self.answered >= 0 and self.grid.step_of(stamp) == self.pending[0]:
            self.out.repeat(self.out.message.header.stamp)
        super().receive(stamp, given)

    def on_command(self, message: Any) -> None:
        """Keep a command for the prediction of the next step."""
        k, command = self.grid.step_of(message.header.stamp), read_named(message, self.plant.control_names)
        self._commanded, self._command = k, command
        self.answer()

    def on_reading(self, i: int, sensor: SensorOfPlant, message: Any) -> None:
        """Keep a measurement of the i-th sensor."""
        k = self.grid.step_of(message.header.stamp)
        self._readings[i, k] = Reading(i, k, read_fields(message, sensor.fields, sensor.names))
        self.answer()

    def on_clock(self, message: Any) -> None:
        """Estimate at a step of the clock."""
        self.receive(message.clock, None)

    def on_state(self, message: Any) -> None:
        """Estimate at a state."""
        self.receive(message.header.stamp, read_state(message, self.plant.state_names))

    def health(self) -> Health:
        """The newest estimate, and of each sensor whether it is as exact as it says."""
        values: dict[str, object] = {
            "answered_step": self.answered,
            "answer_rate_Hz": self.rate.read(self.answered),
        }
        for sensor, c in zip(self._models, self._judged, strict=True) if self.answered >= 0 else ():
            expected = f"{c.mean:.2f} ({c.low:.2f} to {c.high:.2f} expected): " if np.isfinite(c.mean) else ""
            values[f"nis_{sensor.name}"] = expected + c.verdict
        missing = self.missing()
        level = Level.WARN if missing and self.answered >= 0 else Level.OK
        return Health(level, missing or "estimating", values)

    def missing(self) -> str:
        if self.pending is not None:
            return (
                f"waiting for the measurements of step {self.pending[0]}, or the command of the step before"
            )
        unmatched = self.unmatched() if self.answered < 0 else []
        return f"waiting for subscribers of {', '.join(unmatched)}" if unmatched else self.silence()

    def answer(self) -> None:
        if self.pending is None:
            return
        k, state, _ = self.pending
        first = self.is_first
        measured = self._measured(k) if self._sensors else state
        if measured is None or (self.lockstep and not first and self._commanded < k - 1):
            return
        self.pending = None
        self._readings = {key: later for key, later in self._readings.items() if later.step > k}
        if first:
            self.begins_at(k)
        for _ in range(0 if first else k - self.answered):
            self._estimation.predict(self._command)
        estimate = self._estimation.update(k, measured)
        self.answered = k
        self._publish(k, estimate)

    def _measured(self, k: int) -> list[Reading] | None:
        """The readings for step k; None while some that the plant has sent are on their way.

        In lockstep these are known from the scenario, in real time those count that are there.
        """
        if not self.lockstep:
            return [reading for reading in self._readings.values() if reading.step <= k]
        assert self._sensors is not None
        while self._due_at < k:
            self._due_at += 1
            self._due = self._sensors.arrivals(self._due_at)
        found = [self._readings[key] for key in self._due if key in self._readings]
        return found if len(found) == len(self._due) else None

    def _publish(self, k: int, estimate: Array) -> None:
        estimator = self._estimation.estimator
        if estimator.covariance is not None and self.plant.state_message == "odometry":
            _fill_covariance(self.out.message, estimate, estimator.covariance)
        self.out.publish(k, estimate)
        values = list(estimator.telemetry)
        for i, sensor in enumerate(self._models):
            values += self._judge(i, sensor)
        self._telemetry.publish(k, np.array(values, dtype=float))

    def _judge(self, i: int, sensor: SensorOfPlant) -> list[float]:
        """Mean NIS of the newest measurements, its 95 % interval, and the number of the verdict."""
        estimator = self._estimation.estimator
        name = f"innovation_{sensor.name}_{sensor.names[0]}"
        if name in estimator.telemetry_names:
            first = estimator.telemetry_names.index(name)
            innovation = estimator.telemetry[first : first + sensor.size]
            if np.isfinite(innovation).all():
                self._recent[i].append(innovation.copy())
                self._judged[i] = consistency(np.array(self._recent[i]))
        c: Consistency = self._judged[i]
        return [c.mean, c.low, c.high, float(VERDICTS.index(c.verdict))]


def _fill_covariance(message: Any, state: Array, P: Array) -> None:
    """Write the covariance (e, e) of an error into an Odometry: pose in axes of the world, twist in body axes."""
    J = np.eye(6)
    for axis, row in zip(np.eye(3), J[3:, 3:], strict=True):
        turn_into_body(state[3:7], axis, row)  # rows of the matrix from body to world
    message.pose.covariance[:] = (J @ P[:6, :6] @ J.T).ravel()
    message.twist.covariance[:] = P[6:12, 6:12].ravel()
