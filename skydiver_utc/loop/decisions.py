# SPDX-License-Identifier: Apache-2.0
"""The controller's side of the closed loop: one decision for each measured state."""

import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.controllers.protocol import Controller, Decision
from skydiver_utc.disturbances.protocol import Disturbance
from skydiver_utc.estimators.protocol import Estimator
from skydiver_utc.estimators.true_state import TrueState
from skydiver_utc.plants.protocol import Plant

Array = NDArray[np.float64]


class Decider:
    """A controller behind its estimator and the disturbance of its measurements; `solve_time_s` of the last decision.

    For each step `decide`, then `predict`. Both know the plant's `model` only.
    """

    def __init__(
        self,
        controller: Controller,
        estimator: Estimator,
        model: Plant,
        disturbance: Disturbance | None = None,
    ) -> None:
        self.controller = controller
        self.solve_time_s = 0.0
        self._estimator, self._model, self._disturbance = estimator, model, disturbance
        self._predicts = not isinstance(estimator, TrueState)

    def begin(self, control: Array | None = None) -> None:
        """Begin a run, or continue one from an applied control (m,)."""
        self._estimator.reset()
        if self._disturbance is not None:
            self._disturbance.reset()
        self._applied = np.array(self._model.initial_applied(), dtype=float)
        if control is None:
            self.controller.reset()
        else:
            self.controller.resume(control)
            self._applied[: len(control)] = control

    def decide(self, k: int, state: Array, preview: Array) -> Decision:
        """The decision at the state (n,) of step k, with the reference (preview_steps + 1, l) from there on."""
        if self._disturbance is not None:
            state = self._disturbance.measurement(k, state)
        estimate = self._estimator.update(state)
        began_ns = time.perf_counter_ns()
        decision = self.controller.decide(estimate, preview)
        self.solve_time_s = (time.perf_counter_ns() - began_ns) * 1e-9
        self._command = decision.control
        return decision

    def predict(self) -> None:
        """Advance the estimate by one step under the command decided last, with the model's actuators."""
        if self._predicts:
            self._applied = self._model.actuate(self._command, self._applied)
            self._estimator.predict(self._applied)


class Stretch(NamedTuple):
    """A controller from row `first` to the next stretch; it begins from a control (m,) or from the start."""

    first: int
    decider: Decider
    control: Array | None


def decide_at(stretches: Sequence[Stretch], states: Array, controls: int, reference: Array) -> Array:
    """Commands (K, controls) at states (K+1, n) with the reference (K + longest preview, l), without a plant.

    The first stretch begins at row 0.
    """
    commands = np.empty((len(states) - 1, controls))
    ends = [stretch.first for stretch in stretches[1:]] + [len(commands)]
    for (first, decider, control), end in zip(stretches, ends, strict=True):
        decider.begin(control)
        width = decider.controller.preview_steps + 1
        for k in range(first, end):
            # Copies, as a node has them: no controller can change what it is given next.
            commands[k] = decider.decide(k, states[k].copy(), reference[k : k + width].copy()).control
            decider.predict()
    return commands
