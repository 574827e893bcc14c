# SPDX-License-Identifier: Apache-2.0
"""A scenario flown by the wall clock in this process, and changed while it flies."""

from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.controllers.protocol import Controller
from skydiver_utc.controllers.utc.tunable import Tunable
from skydiver_utc.controllers.utc.unscented_transform_controller import UnscentedTransformController
from skydiver_utc.disturbances.composed import Composed
from skydiver_utc.disturbances.protocol import STILL_AIR, Disturbance
from skydiver_utc.loop.build import build_controller, build_estimator, build_reference, model_beside
from skydiver_utc.loop.decisions import Decider
from skydiver_utc.loop.plant_steps import PlantSteps
from skydiver_utc.parameters import ParameterError, Scenario
from skydiver_utc.parameters.conversion import slot_settings
from skydiver_utc.parameters.fields import SlotSettings
from skydiver_utc.parameters.registry import factory, settings_class
from skydiver_utc.references.protocol import Reference
from skydiver_utc.view.live_signals import Instant, Signals

Array = NDArray[np.float64]
_LONGEST_S = 36000.0
# Of the charts: how far they look back, and how densely.
_SHOWN_S, _ROWS_PER_S = 10.0, 50.0
_BLOCK_STEPS = 256
# A gust that turns the body by some ten degrees and is over before one loses patience; chosen by eye.
_GUST = {"speed_m_s": 10.0, "to_deg": 90.0, "duration_s": 2.0}
# Settings that a UTC takes between steps, without forgetting what it has learnt of Pu.
_BETWEEN_STEPS = {"P_err", "Qu"}


class LiveFlight:
    """A closed loop of the objects that `simulate` uses, flown step by step.

    scenario: as changed so far; plant; tracked: names of the outputs that the reference is for
    ended: why the flight cannot go on, else empty
    gust: the settings of the next gust; None for a plant on which wind has no effect
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario.replace(duration_s=_LONGEST_S)
        self.ended = ""
        self._steps = PlantSteps(self.scenario)
        self.plant = self._steps.plant
        self._gusts = _Gusts()
        self.gust: SlotSettings | None = None
        if self.plant.state_message == "odometry":
            self.gust = settings_class("disturbance", "gust").model_validate({"start_s": 0.0, **_GUST})
            parts = (*self._steps.disturbance.parts, self._gusts)
            self._steps.disturbance = Composed(parts, self.plant, self.scenario.dt_s)
        self._reference = build_reference(self.scenario)
        self.name, self.tracked = self.scenario.name, self._reference.outputs
        self._rows: deque[Array] = deque(maxlen=round(_SHOWN_S * _ROWS_PER_S))
        self._block = 0, np.empty((0, len(self.tracked)))  # first step and values of a part of the reference
        self._model = model_beside(self.plant, self.scenario)
        estimator = build_estimator(self.scenario, self._model)
        controller = self._built(self.scenario, self._reference)
        deviates = any(name.startswith("std_") for name in controller.telemetry_names)
        self.signals = Signals(self.plant, self.tracked, deviates)
        self._decider = Decider(controller, estimator, self._model, self._steps.disturbance)
        self.reset()

    def reset(self) -> None:
        """Begin again, without gusts and pushes and with the settings as changed."""
        self._steps.reset()
        self._steps.begin()
        self._decider.begin()
        self._time_s, self.ended, self._solve_time_s = 0.0, "", 0.0
        self._deviations = np.full(len(self.plant.control_names), np.nan)
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
        scenario, before = _changed(self.scenario, values), self.scenario
        reference = self._reference
        if scenario.reference != before.reference:
            reference = build_reference(scenario)
        if scenario.controller != before.controller:
            between = _set_between_steps(self._decider.controller, before.controller, scenario.controller)
            if not between:
                controller = self._built(scenario, reference)
                controller.resume(self._steps.control)
                self._decider.controller = controller
        self.scenario, self._reference = scenario, reference
        self._block = 0, np.empty((0, len(self.tracked)))

    def blow(self) -> None:
        """Let a gust begin now."""
        if self.gust is None:
            raise ParameterError("wind has no effect on this plant: push it instead")
        now = self.gust.replace(start_s=self._steps.k * self.scenario.dt_s)
        gust = factory("disturbance", now.kind)(now, self.plant, self.scenario.dt_s, (self.scenario.seed, 0))
        self._gusts.blown.append(gust)

    def push(self, name: str, by: float) -> None:
        """Change one state at once."""
        pushed = self._steps.state.copy()
        pushed[self.plant.state_names.index(name)] += by
        self._steps.state = pushed

    def now(self) -> Instant:
        """The present instant."""
        k = self._steps.k
        return Instant(
            time_s=k * self.scenario.dt_s,
            state=self._steps.state.copy(),
            applied=self._steps.applied.copy(),
            reference=self._preview(k, 1)[0],
            wind=self._steps.disturbance.wind(k),
            deviations=self._deviations.copy(),
            solve_time_s=self._solve_time_s,
        )

    def history(self) -> Array:
        """Rows of the signals (R, columns) of the last ten seconds."""
        return np.array(self._rows).reshape(-1, self.signals.count)

    def look_ahead(self, seconds: float = 0.0) -> tuple[Array, Array]:
        """States (S, steps + 1, n) to the horizon, or further, and what the actuators then hold (S, a).

        Row 0: the model under the command in force; the others, which only a UTC has: under its sigma points.
        """
        controller, k, m = self._decider.controller, self._steps.k, len(self.plant.control_names)
        state, control = self._steps.state, self._steps.control
        at_least = round(seconds / self.scenario.dt_s)
        if isinstance(controller, UnscentedTransformController):
            steps = max(controller.horizon, at_least)
            preview = self._reference.preview(k, steps + controller.preview_steps + 1)
            states, controls = controller.look_ahead(state, preview, steps)
        else:
            steps = max(1, controller.preview_steps, at_least)
            states, controls = self._held(state, control, steps), control[np.newaxis]
        applied = np.tile(self.plant.initial_applied(), (len(states), 1))
        applied[:, :m] = controls
        return states, applied

    def _step(self) -> None:
        controller, k = self._decider.controller, self._steps.k
        preview = self._preview(k, controller.preview_steps + 1)
        decision = self._decider.decide(k, self._steps.measured, preview)
        if not self._steps.step(decision.control):
            self.ended = self._steps.reason
        self._decider.predict()
        self._solve_time_s = self._decider.solve_time_s
        self._deviations[:] = np.nan
        names = controller.telemetry_names
        for c, name in enumerate(self.plant.control_names):
            if f"std_{name}" in names:
                self._deviations[c] = decision.telemetry[names.index(f"std_{name}")]

    def _preview(self, k: int, count: int) -> Array:
        """The reference (count, l) from step k on; steps are computed in blocks, as of most only one is new."""
        first, block = self._block
        if not first <= k <= first + len(block) - count:
            first, block = k, self._reference.preview(k, count + _BLOCK_STEPS)
            self._block = first, np.ascontiguousarray(block, dtype=float)
        return self._block[1][k - self._block[0] :][:count]

    def _held(self, state: Array, control: Array, steps: int) -> Array:
        """States (1, steps + 1, n) of the model under a held control."""
        states = np.empty((1, steps + 1, len(state)))
        states[0, 0] = state
        for j in range(steps):
            self._model.bound_model.step(states[0, j], control, states[0, j + 1])
        return states

    def _built(self, scenario: Scenario, reference: Reference) -> Controller:
        """The controller of a scenario; it has decided once, so that no step waits for the compiler."""
        controller = build_controller(scenario, self._model, reference)
        controller.decide(self._model.initial_state(), reference.preview(0, controller.preview_steps + 1))
        controller.reset()
        return controller


class _Gusts(Disturbance):
    """Gusts that users let begin, as one wind."""

    def __init__(self) -> None:
        self.blown: list[Disturbance] = []

    def wind(self, k: int) -> Array:
        """The sum of the gusts (3,) at step k [m/s]."""
        return sum((gust.wind(k) for gust in self.blown), start=STILL_AIR)

    def reset(self) -> None:
        """Still air."""
        self.blown.clear()


def _changed(scenario: Scenario, values: Mapping[str, Any]) -> Scenario:
    """The scenario with other values in the blocks of its slots; no other block is checked again."""
    blocks: dict[str, Any] = {}
    errors: list[str] = []
    for name, value in values.items():
        slot, *path = name.split(".")
        block = blocks.setdefault(slot, getattr(scenario, slot).as_dict())
        *within, last = (int(key) if key.isdecimal() else key for key in path)
        for key in within:
            block = block[key]
        block[last] = value
    settings = {slot: slot_settings(slot, slot, block, errors) for slot, block in blocks.items()}
    if errors:
        raise ParameterError("; ".join(errors))
    return scenario.replace(**settings)


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
