# SPDX-License-Identifier: Apache-2.0
"""The controller's side of the closed loop: one decision for each measured state."""

import time
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.protocol import Controller, Decision
from skydiver_utc.disturbances.protocol import Disturbance
from skydiver_utc.estimators.protocol import Estimator
from skydiver_utc.loop.estimation import Estimation
from skydiver_utc.plants.protocol import Plant


class Decider:
    """A controller and its estimate; for each step `decide`, then `predict`. `solve_time_s`: of the last decision."""

    def __init__(
        self,
        controller: Controller,
        estimator: Estimator,
        model: Plant,
        disturbance: Disturbance | None = None,
    ) -> None:
        self.controller = controller
        self.solve_time_s = 0.0
        self._estimation = Estimation(estimator, model, disturbance)
        self._measures = bool(estimator.telemetry_names)

    @property
    def telemetry_names(self) -> tuple[str, ...]:
        """Of the telemetry of decisions: the controller's, then the estimator's."""
        return (*self.controller.telemetry_names, *self._estimation.estimator.telemetry_names)

    def begin(self, control: Array | None = None) -> None:
        """Begin a run, or let a controller continue one from an applied control (m,): the estimate is kept."""
        if control is None:
            self._estimation.begin()
            self.controller.reset()
        else:
            self._estimation.begin_measurements()
            self.controller.resume(control)

    def decide(self, k: int, measured: Any, preview: Array) -> Decision:
        """The decision at the state (n,) of step k, or at the readings of sensors that arrived at it.

        preview: the reference (preview_steps + 1, l) from there on
        """
        estimate = self._estimation.update(k, measured)
        began_ns = time.perf_counter_ns()
        decision = self.controller.decide(estimate, preview)
        self.solve_time_s = (time.perf_counter_ns() - began_ns) * 1e-9
        self._command = decision.control
        if not self._measures:
            return decision
        return decision._replace(
            telemetry=np.append(decision.telemetry, self._estimation.estimator.telemetry)
        )

    def predict(self) -> None:
        """Advance the estimate by one step under the command decided last."""
        self._estimation.predict(self._command)


class Stretch(NamedTuple):
    """A controller from row `first` to the next stretch; it begins from a control (m,) or from the start."""

    first: int
    decider: Decider
    control: Array | None


def decide_at(
    stretches: Sequence[Stretch], first_step: int, states: Array, controls: int, reference: Array
) -> Array:
    """Commands (K, controls) at states or estimates (K, n), without a plant.

    first_step: of row 0, where the first stretch begins; reference (K + longest preview, l)
    """
    commands = np.empty((len(states), controls))
    ends = [stretch.first for stretch in stretches[1:]] + [len(commands)]
    for (first, decider, control), end in zip(stretches, ends, strict=True):
        decider.begin(control)
        width = decider.controller.preview_steps + 1
        for i in range(first, end):
            # Copies, as a node has them: no controller can change what it is given next.
            preview = reference[i : i + width].copy()
            commands[i] = decider.decide(first_step + i, states[i].copy(), preview).control
            decider.predict()
    return commands
