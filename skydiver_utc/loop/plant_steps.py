# SPDX-License-Identifier: Apache-2.0
"""The plant's side of the closed loop: one step for each command, in process and in the plant node."""

import math

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.estimators.protocol import Reading
from skydiver_utc.loop.build import build_disturbances, build_sensors, build_true_plant
from skydiver_utc.loop.outcome import Outcome
from skydiver_utc.parameters import Scenario
from skydiver_utc.plants.protocol import Plant


def states_to_push(plant: Plant) -> tuple[str, ...]:
    """The states that a push can change: of a body with a pose its velocities."""
    return plant.state_names[7:] if plant.state_message == "odometry" else plant.state_names


class PlantSteps:
    """The true plant of a run and its disturbances: at step `k` its `state` (n,), before it `applied` (a,).

    `readings` of sensors arrive at step k, where the estimator has sensors; else they are None. `k` is -1 before the
    run; the run is over after the last step, or when the plant has a fault; a mishap is its outcome, and it continues.
    `pushed` (n,): what users added to the state of step k, None for nothing.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.plant = build_true_plant(scenario)
        self.disturbance = build_disturbances(scenario, self.plant)
        self.sensors = build_sensors(scenario, self.plant)
        self._scenario, self._steps = scenario, scenario.steps
        lag_s = scenario.truth.actuator_lag_s
        # Of the way to a held command in one step: the exact solution.
        self._share = -math.expm1(-scenario.dt_s / lag_s) if lag_s else 1.0
        self.reset()
        # Compiled before the run.
        command = self.applied[: len(self.plant.control_names)]
        self.plant.advance(self.plant.initial_state(), self.applied, command)

    def reset(self) -> None:
        """Before a run."""
        self.k = -1
        self.state = np.array(self.plant.initial_state(), dtype=float)
        self.disturbance.reset()
        self.applied = np.array(self.plant.initial_applied(), dtype=float)
        self._lagged = self.control
        self.pushed: Array | None = None
        self._push: Array | None = None  # for the next step
        self._resets = False
        self.outcome, self.reason = Outcome.COMPLETED, f"{self._steps} steps done"
        self.readings: list[Reading] | None = None
        if self.sensors is not None:
            self.sensors.reset()

    def begin(self) -> bool:
        """Go to step 0; False where the run is over at once."""
        self.k = 0
        self._read_sensors(self.applied)
        return self._goes_on()

    def step(self, command: Array) -> bool:
        """One step under a command (m,); False when the run is over."""
        if self._share < 1.0:
            bounded = np.minimum(np.maximum(command, self.plant.minimum), self.plant.maximum)
            command = self._lagged = self._lagged + self._share * (bounded - self._lagged)
        before = self.applied
        state, self.applied = self.plant.advance(self.state, before, command)
        self.k += 1
        state = self.disturbance.state(self.k, state)
        if self._resets:
            self.push(self.plant.initial_state() - state)
        self.pushed, self._push, self._resets = self._push, None, False
        self.state = state if self.pushed is None else state + self.pushed
        self._read_sensors(before)
        return self._goes_on() and self.k < self._steps

    def push(self, change: Array) -> None:
        """Add to the state (n,) at the next step."""
        self._push = change if self._push is None else self._push + change

    def reset_state(self) -> None:
        """Reset the state (n,) at the next step; time, actuators and what estimates or controls go on."""
        self._push, self._resets = None, True

    def _read_sensors(self, before: Array) -> None:
        if self.sensors is not None:
            control = self.plant.step_control(before, self.applied)
            over_ground = self.disturbance.over_ground(self.k, self.state)
            self.readings = self.sensors.read(self.k, self.state, over_ground, control)

    @property
    def measured(self) -> Array | list[Reading]:
        """The estimator's measurement at step k: the state (n,), or the readings that arrived."""
        return self.state if self.readings is None else self.readings

    @property
    def control(self) -> Array:
        """The applied control (m,) of the step before."""
        return self.applied[: len(self.plant.control_names)]

    def end(self, outcome: Outcome, reason: str) -> None:
        """End the run with this outcome and one sentence on it."""
        self.outcome, self.reason = outcome, reason

    def _goes_on(self) -> bool:
        """Look for a fault or a mishap in the state; False where the run cannot go on."""
        if fault := self.plant.fault(self.state):
            self.end(Outcome.DIVERGED, f"{fault} at {self.k * self._scenario.dt_s:.3f} s")
        elif self.outcome is Outcome.COMPLETED and (mishap := self.plant.mishap(self.state)):
            self.end(Outcome.ROLLED_OVER, f"{mishap} at {self.k * self._scenario.dt_s:.3f} s")
        return not fault
