# SPDX-License-Identifier: Apache-2.0
"""A scenario flown by the wall clock in this process, and changed while it flies."""

from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.protocol import Controller
from skydiver_utc.controllers.utc.tunable import Tunable
from skydiver_utc.controllers.utc.unscented_transform_controller import UnscentedTransformController
from skydiver_utc.disturbances.composed import Composed
from skydiver_utc.loop.build import build_compiled_controller, build_estimator, build_reference, model_beside
from skydiver_utc.loop.decisions import Decider
from skydiver_utc.loop.plant_steps import PlantSteps
from skydiver_utc.parameters import ParameterError, Scenario, override
from skydiver_utc.plants.protocol import Plant
from skydiver_utc.references.protocol import Reference
from skydiver_utc.view.charts import Instant, Signals
from skydiver_utc.view.gusts import Gusts

_LONGEST_S = 36000.0
# Of the charts: how far they look back, and how densely.
_SHOWN_S, _ROWS_PER_S = 10.0, 50.0
# Settings that a UTC takes between steps, without forgetting what it has learnt of Pu.
_BETWEEN_STEPS = {"P_err", "Qu"}


class LiveFlight:
    """A closed loop of the objects that `simulate` uses, flown step by step.

    scenario: as changed so far; plant; tracked: names of the outputs that the reference is for
    ended: why the flight cannot go on, else empty
    """

    changes: tuple[str, ...] = ("reference", "controller")

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario.replace(duration_s=_LONGEST_S)
        self.ended = ""
        self._steps = PlantSteps(self.scenario)
        self.plant = self._steps.plant
        self.gusts = Gusts(self.plant)
        if self.gusts.settings is not None:
            parts = (*self._steps.disturbance.parts, self.gusts)
            self._steps.disturbance = Composed(parts, self.plant, self.scenario.dt_s)
        self._reference = build_reference(self.scenario)
        self.name, self.tracked = self.scenario.name, self._reference.outputs
        self._rows: deque[Array] = deque(maxlen=round(_SHOWN_S * _ROWS_PER_S))
        self._model = model_beside(self.plant, self.scenario)
        estimator = build_estimator(self.scenario, self._model)
        controller = build_compiled_controller(self.scenario, self._model, self._reference)
        self.signals = Signals(self.plant, self.tracked, controller.telemetry_names)
        self._decider = Decider(controller, estimator, self._model, self._steps.disturbance)
        self.reset()

    def reset(self) -> None:
        """Begin again, without gusts and pushes and with the settings as changed."""
        self._steps.reset()
        self._steps.begin()
        self._decider.begin()
        self._time_s, self.ended, self._telemetry = 0.0, "", dict[str, float]()
        self._rows.clear()

    def advance(self, seconds: float) -> None:
        """Fly on by so much simulated time, in whole steps."""
        self._time_s += seconds
        every = max(1, round(1.0 / (_ROWS_PER_S * self.scenario.dt_s)))
        while not self.ended and self._steps.k * self.scenario.dt_s < self._time_s:
            self._step()
            if self._steps.k % every == 0:
                self._rows.append(self.signals.row(self.now()))

    def change(self, values: Mapping[str, Any]) -> None:
        """Fly on with other settings of the reference and the controller, by dotted name. Raises `ParameterError`.

        Another controller continues from the control in force.
        """
        scenario, before = override(self.scenario, values), self.scenario
        reference = self._reference
        if scenario.reference != before.reference:
            reference = build_reference(scenario)
        if scenario.controller != before.controller:
            between = _set_between_steps(self._decider.controller, before.controller, scenario.controller)
            if not between:
                controller = build_compiled_controller(scenario, self._model, reference)
                controller.resume(self._steps.control)
                self._decider.controller = controller
        self.scenario, self._reference = scenario, reference

    def pause(self, paused: bool) -> None:
        """It stands still with its page."""

    def blow(self) -> None:
        """Let a gust begin now."""
        self.gusts.blow(self._steps.k)

    def push(self, name: str, by: float) -> None:
        """Change one state at the next step."""
        self._steps.push(np.where(np.array(self.plant.state_names) == name, by, 0.0))

    def now(self) -> Instant:
        """The present instant."""
        k = self._steps.k
        return Instant(
            time_s=k * self.scenario.dt_s,
            state=self._steps.state.copy(),
            applied=self._steps.applied.copy(),
            reference=self._reference.preview(k, 1)[0],
            wind=self._steps.disturbance.wind(k),
            telemetry=self._telemetry,
        )

    def history(self) -> Array:
        """Rows of the signals (R, columns) of the last ten seconds."""
        return np.array(self._rows).reshape(-1, self.signals.count)

    def look_ahead(self, seconds: float = 0.0) -> tuple[Array, Array]:
        """States (S, steps + 1, n) to the horizon, or further, and what the actuators then hold (S, a)."""
        steps, of = self._steps, (self._decider.controller, self._model, self._reference)
        return look_ahead(*of, steps.k, steps.state, steps.control, seconds)

    def _step(self) -> None:
        controller, k = self._decider.controller, self._steps.k
        preview = self._reference.preview(k, controller.preview_steps + 1)
        decision = self._decider.decide(k, self._steps.measured, np.ascontiguousarray(preview, dtype=float))
        if not self._steps.step(decision.control):
            self.ended = self._steps.reason
        self._decider.predict()
        self._telemetry = dict(zip(controller.telemetry_names, decision.telemetry.tolist(), strict=False))
        self._telemetry["solve_time"] = self._decider.solve_time_s


def _set_between_steps(controller: Controller, before: Any, after: Any) -> bool:
    """Set what a UTC takes between steps; False where something else has changed. Raises `ParameterError`."""
    changed = {name for name in type(after).model_fields if getattr(after, name) != getattr(before, name)}
    if not (isinstance(controller, Tunable) and changed <= _BETWEEN_STEPS):
        return False
    at_step = after.at_step(controller.dt)
    for name in changed:
        try:
            setattr(controller, name, getattr(at_step, name))
        except ValueError as error:
            raise ParameterError(f"controller.{name}: {error}") from error
    return True


def look_ahead(
    controller: Controller,
    model: Plant,
    reference: Reference,
    k: int,
    state: Array,
    control: Array,
    seconds: float,
) -> tuple[Array, Array]:
    """States (S, steps + 1, n) from a state (n,) at step k on, and what the actuators then hold (S, a).

    To the controller's horizon or, where that is further, so many seconds. Row 0: the model under the control in force
    (m,); the others, which only a UTC has: under its sigma points.
    """
    at_least = round(seconds / model.dt_s)
    if isinstance(controller, UnscentedTransformController):
        steps = max(controller.horizon, at_least)
        preview = reference.preview(k, steps + controller.preview_steps + 1)
        states, controls = controller.look_ahead(state, preview, steps)
    else:
        steps, controls = max(1, controller.preview_steps, at_least), control[np.newaxis]
        states = np.empty((1, steps + 1, len(state)))
        states[0, 0] = state
        for j in range(steps):
            model.bound_model.step(states[0, j], control, states[0, j + 1])
    applied = np.tile(model.initial_applied(), (len(states), 1))
    applied[:, : len(control)] = controls
    return states, applied
