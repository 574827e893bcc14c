# SPDX-License-Identifier: Apache-2.0
"""The estimator's side of the closed loop: one estimate of the state for each step."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.disturbances.protocol import Disturbance
from skydiver_utc.estimators.protocol import Estimator
from skydiver_utc.estimators.true_state import TrueState
from skydiver_utc.plants.protocol import Plant


class Estimation:
    """An estimator behind the disturbance of its measurements; for each step `update`, then `predict`.

    It knows the plant's `model` only, with whose actuators it predicts under the commands.
    """

    def __init__(self, estimator: Estimator, model: Plant, disturbance: Disturbance | None = None) -> None:
        self.estimator, self._model, self._disturbance = estimator, model, disturbance
        self._predicts = not isinstance(estimator, TrueState)
        self.begin()

    def begin(self) -> None:
        """Begin at the step of the next update."""
        self.estimator.reset()
        self._applied = np.array(self._model.initial_applied(), dtype=float)
        self.begin_measurements()

    def begin_measurements(self) -> None:
        """Let the disturbance of the measurements begin; the estimate is kept."""
        if self._disturbance is not None:
            self._disturbance.reset()

    def update(self, k: int, measured: Any) -> Array:
        """The estimate (n,) at the state (n,) of step k, or at the readings of sensors that arrived at it."""
        if self._disturbance is not None and not isinstance(measured, list):
            measured = self._disturbance.measurement(k, measured)
        self.estimator.step = k
        return self.estimator.update(measured)

    def predict(self, command: Array) -> None:
        """Advance the estimate by one step under a command (m,)."""
        if self._predicts:
            self._applied = self._model.actuate(command, self._applied)
            self.estimator.predict(self._applied)


def estimate_at(
    estimations: Mapping[int, Estimation], first_step: int, measured: Sequence[Any], commands: Array
) -> Array:
    """Estimates (K, n) at recorded measurements and commands (K, m), without a plant.

    estimations: by the row from which on each is in force; the first one is row 0, whose step is first_step
    """
    rows, estimation = [], estimations[0]
    for i, command in enumerate(commands):
        estimation = estimations.get(i, estimation)
        rows.append(estimation.update(first_step + i, measured[i].copy()))
        estimation.predict(command)
    return np.array(rows)
