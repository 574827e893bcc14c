# SPDX-License-Identifier: Apache-2.0
"""Reading, setting and copying a UTC between steps, and sending it to another process."""

from collections.abc import Callable
from copy import copy, deepcopy
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from typing_extensions import Self

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.roll_out import RollOut
from skydiver_utc.controllers.utc.construction import plain
from skydiver_utc.controllers.utc.coupling import CouplingSchedule
from skydiver_utc.controllers.utc.horizon_outputs import HorizonOutputs
from skydiver_utc.controllers.utc.law import Law, draw
from skydiver_utc.controllers.utc.output_offset import OutputOffset
from skydiver_utc.controllers.utc.settings import UtcSettings, matrix
from skydiver_utc.plants.function import bounds, rates
from skydiver_utc.plants.protocol import Plant

# The share of their distance at which sigma points show the slope of the outputs.
_OF_SLOPE = 0.01
_SETTABLE = ("P_err", "Qu", "minimum", "maximum", "rate", "dt")
# Of the law's arrays, those that a step changes or a user sets.
_CHANGING = (
    *("control", "Pu", "predicted", "innovation", "offset", "spread", "watch", "singly"),
    *("P_err", "limits", "gain"),
)


class Tunable:
    """The part of a UTC that users read and set; every other public attribute is refused."""

    _made_of: tuple[UtcSettings, Plant, tuple[str, ...], Callable[..., Any] | None]
    _law: Law
    _outputs: HorizonOutputs
    _coupling: CouplingSchedule | None
    _offset: OutputOffset | None
    _limits: Array
    _Qu: Array
    _initial: Array
    _initial_Pu: Array
    _preview_steps: int
    _telemetry_names: tuple[str, ...]
    _roll_out: RollOut
    _example: tuple[Array, Array, Array]
    _out: Array
    # Begins anew with other settings, plant, outputs and dynamics.
    _make: Callable[..., None]
    # Checks state and reference of `step`; returns state and preview as arrays.
    _checked: Callable[..., tuple[Array, Array]]

    @property
    def settings(self) -> UtcSettings:
        """The settings that it was made of."""
        return self._made_of[0]

    @property
    def plant(self) -> Plant:
        """The plant that it predicts."""
        return self._made_of[1]

    @property
    def preview_steps(self) -> int:
        """Steps of reference that a decision takes beyond the present one."""
        return self._preview_steps

    @property
    def telemetry_names(self) -> tuple[str, ...]:
        """Names of the values behind a decision."""
        return self._telemetry_names

    @property
    def control(self) -> Array:
        """The control now in force (m,), a copy."""
        return self._law.control.copy()

    @property
    def Pu(self) -> Array:
        """The covariance of the control now (m, m), a copy; `reset` begins from another one."""
        return self._law.Pu.copy()

    @property
    def P_err(self) -> Array:
        """Covariance of the tracking error (l, l), a copy; set it as in the settings, also between steps."""
        if self._outputs.not_known:
            at_rest = self._checked(self.plant.initial_state(), np.zeros(len(self._outputs.tracked)))
            self._derive_P_err(*at_rest)
        return self._outputs.error

    @P_err.setter
    def P_err(self, value: Any) -> None:
        self._outputs.set_error(plain(value))

    @property
    def Qu(self) -> Array:
        """The growth of Pu in each step (m, m), a copy; set it as in the settings, also between steps."""
        return self._Qu.copy()

    @Qu.setter
    def Qu(self, value: Any) -> None:
        if self._coupling is not None:
            raise ValueError("Qu follows from the coupling in each step: it cannot be set beside it")
        self._Qu[:] = matrix("Qu", plain(value), self.plant.control_names)

    @property
    def minimum(self) -> Array:
        """Lower bounds of the controls (m,), a copy; set one number for all or (m,), also between steps."""
        return np.array(self._limits[0])

    @minimum.setter
    def minimum(self, value: ArrayLike) -> None:
        self._limits[:2] = bounds(value, self.maximum, len(self._initial))

    @property
    def maximum(self) -> Array:
        """Upper bounds of the controls (m,), as `minimum`; where both are equal the control is frozen."""
        return np.array(self._limits[1])

    @maximum.setter
    def maximum(self, value: ArrayLike) -> None:
        self._limits[:2] = bounds(self.minimum, value, len(self._initial))

    @property
    def rate(self) -> Array:
        """Largest changes of the controls per unit of time (m,), a copy; set one number for all or (m,)."""
        return np.array(self._limits[2] / self.dt)

    @rate.setter
    def rate(self, value: ArrayLike) -> None:
        self._limits[2] = rates(value, len(self._initial)) * self.dt

    @property
    def dt(self) -> float:
        """Length of a step. Horizon and Qu count in steps and stay; with `tuned_at_dt_s` they are converted."""
        return self.plant.dt_s

    @dt.setter
    def dt(self, value: float) -> None:
        settings, plant, outputs, dynamics = self._made_of
        memory, other = self._memory(), copy(plant)
        other.model, other.dt_s = plant.model_of_step(value), float(value)
        share = other.dt_s / plant.dt_s
        if len(settings.at_step(other.dt_s).steps) != len(settings.at_step(plant.dt_s).steps):
            raise ValueError(f"dt = {value:g}: two steps of the horizon would be one; choose a smaller dt")
        memory["limits"][2] *= share
        if settings.tuned_at_dt_s is not None:
            memory["_Qu"] *= share
        if self._offset is not None:
            memory["offset_of"] = []  # the states measured so far are not a new step apart
        self._make(settings, other, outputs, dynamics)
        self._remember(memory)

    def __setattr__(self, name: str, value: Any) -> None:
        if not name.startswith("_") and not hasattr(type(self), name):
            raise AttributeError(
                f"{type(self).__name__} has no {name}; what can be set is {', '.join(_SETTABLE)}"
            )
        super().__setattr__(name, value)

    def __reduce__(self) -> Any:
        return _remembered, (type(self), self._made_of, self._memory())

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """A copy that goes on by itself; the plant, which keeps no state, is shared."""
        return _remembered(type(self), self._made_of, self._memory())

    def _memory(self) -> dict[str, Any]:
        """All that a step changes or a user has set, as copies."""
        found = {name: getattr(self._law, name).copy() for name in _CHANGING}
        found |= {name: deepcopy(getattr(self, name)) for name in ("_Qu", "_started", "_moved")}
        found["not_known"] = self._outputs.not_known.copy()
        found["coupling"] = None if self._coupling is None else self._coupling.memory
        found["offset_of"] = None if self._offset is None else self._offset.memory
        return found

    def _remember(self, memory: dict[str, Any]) -> None:
        for name in _CHANGING:
            getattr(self._law, name)[:] = memory[name]
        self._Qu[:], self._started, self._moved = memory["_Qu"], memory["_started"], memory["_moved"]
        self._outputs.not_known = set(memory["not_known"])
        if self._coupling is not None:
            self._coupling.memory = memory["coupling"]
        if self._offset is not None:
            self._offset.memory = memory["offset_of"]

    @cached_property
    def _roll(self) -> Callable[[Array, Array, Array], None]:
        """The roll-out of the points without an update, which a flight does not need."""
        return self._roll_out.between(draw, None, self._law, *self._example)

    def _derive_P_err(self, state: Array, preview: Array) -> None:
        """Take P_err from what the initial Pu does to the outputs: by their slope at the start, or now."""
        law = self._law
        kept = law.control.copy(), law.Pu.copy(), law.spread.copy()
        law.control[:], law.Pu[:] = self._initial, self._initial_Pu
        for share in (_OF_SLOPE, 1.0):
            for x, ahead in ((self.plant.initial_state(), np.zeros_like(preview)), (state, preview)):
                if self._outputs.not_known:
                    law.spread[:] = share
                    self._roll(x, ahead, self._out)
                    self._outputs.derive_error(law.of_roll_out, share)
        law.control[:], law.Pu[:], law.spread[:] = kept


def _remembered(kind: Any, made_of: tuple[Any, ...], memory: dict[str, Any]) -> Any:
    """A controller made of settings, plant, outputs and dynamics, that goes on from a memory."""
    settings, plant, outputs, dynamics = made_of
    made = kind(settings, plant, outputs, dynamics=dynamics)
    made._remember(memory)
    return made
