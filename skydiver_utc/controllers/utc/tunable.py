# SPDX-License-Identifier: Apache-2.0
"""Making, reading, setting and copying a UTC, and sending it to another process."""

from collections.abc import Callable
from copy import copy
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from typing_extensions import Self

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.limits import limits_of
from skydiver_utc.controllers.protocol import DIVERGED_POINTS
from skydiver_utc.controllers.utc.construction import (
    controls_of,
    initial_covariance,
    law_of,
    plain,
)
from skydiver_utc.controllers.utc.coupling import CouplingSchedule
from skydiver_utc.controllers.utc.dynamics import dynamics_of
from skydiver_utc.controllers.utc.horizon_outputs import HorizonOutputs
from skydiver_utc.controllers.utc.law import draw, update
from skydiver_utc.controllers.utc.output_offset import OutputOffset
from skydiver_utc.controllers.utc.settings import UtcSettings, matrix
from skydiver_utc.plants.function import bounds, numbers, rates
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
    """A UTC between its steps: what users read and set; every other public attribute is refused."""

    settings: UtcSettings
    plant: Plant
    horizon: int
    preview_steps: int
    telemetry_names: tuple[str, ...]

    def __init__(
        self,
        settings: UtcSettings,
        plant: Plant,
        outputs: tuple[str, ...] = (),
        dt_s: float = 0.0,
        seed: int = 0,
        *,
        dynamics: Callable[..., Any] | None = None,
    ) -> None:
        outputs = outputs or plant.output_names
        self._made = partial(type(self), settings=settings, plant=plant, outputs=outputs, dynamics=dynamics)
        of_step, controls = settings.at_step(plant.dt_s), plant.control_names
        # Read by users, and refused when they set them.
        vars(self).update(
            settings=settings,
            plant=plant,
            horizon=of_step.steps[-1],
            preview_steps=of_step.preview_steps(plant.dt_s),
            telemetry_names=(
                *(f"predicted_{name}" for name in outputs),
                *(f"innovation_{name}" for name in outputs),
                *(f"std_{name}" for name in controls),
                "repaired_covariance",
                "recovery",
                DIVERGED_POINTS,
            ),
        )
        self._limits, self._initial = limits_of(plant), plant.initial_control()
        self._after = controls_of("after_reference", of_step.after_reference, plant)
        controls_of("nominal", {name: nominal.value for name, nominal in of_step.nominal.items()}, plant)
        Pu, Qu = initial_covariance(of_step, self._limits, controls), of_step.Qu
        self._initial_Pu = Pu
        self._Qu = of_step.Qu_ratio * Pu if Qu is None else matrix("Qu", Qu, controls)
        self._coupling: CouplingSchedule | None = None
        if of_step.coupling is not None:
            self._coupling = CouplingSchedule(of_step.coupling, Pu, controls, of_step.Qu_ratio, plant.dt_s)
        self._outputs = HorizonOutputs(of_step, plant, outputs)
        inside = dynamics_of(of_step, plant, outputs, dynamics)
        self._law, self._roll_out = law_of(of_step, plant, self._outputs, self._limits, inside, Pu)
        self._offset: OutputOffset | None = None
        if of_step.offset_share > 0.0:
            self._offset = OutputOffset(
                plant, self._outputs, of_step.steps, of_step.offset_share, self._law.offset
            )
        self._changing = [*(getattr(self._law, name) for name in _CHANGING), self._Qu]
        self._out = np.empty(len(self.telemetry_names) + 1)
        self._example = np.empty(plant.model.state_size), np.empty((1, len(outputs))), self._out
        self._run = self._roll_out.between(draw, update, self._law, *self._example)
        self.reset()

    def reset(self, control: ArrayLike | None = None, Pu: ArrayLike | None = None) -> None:
        """Start again from the plant's initial control (m,) and the initial covariance (m, m), or from others.

        One number is for all controls. Raises ValueError for other shapes and what is no number.
        """
        m = len(self._initial)
        start = self._initial if control is None else numbers("control", control)
        start = of_shape("control", np.full(m, start) if start.ndim == 0 else start, (m,))
        covariance = None if Pu is None else of_shape("Pu", np.atleast_2d(numbers("Pu", Pu)), (m, m))
        self.resume(start)
        self._moved = False
        if covariance is not None:
            self._law.Pu[:] = covariance
            self._started = True

    def resume(self, control: Array) -> None:
        """Start from this control (m,), the one applied last, with Pu as at a run's first step.

        Whether the reference has moved already is not known then; a control nearer to that after it says so.
        """
        self._law.control[:] = np.clip(control, self._limits[0], self._limits[1])
        self._law.predicted[:], self._law.innovation[:] = 0.0, 0.0
        self._law.Pu[:] = self._initial_Pu
        self._law.spread[:], self._law.watch[:], self._law.singly[:] = 1.0, np.inf, False
        if self._offset is not None:
            self._offset.reset()
        if self._coupling is not None:
            self._coupling.reset()
        self._started = self._coupling is None
        self._moved = bool(np.linalg.norm(control - self._after) < np.linalg.norm(control - self._initial))

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
        preview = np.zeros((self.preview_steps + 1, len(self._outputs.tracked)))
        self._derive_P_err(self.plant.initial_state(), preview)
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
        settings, plant, other = self.settings, self.plant, copy(self.plant)
        other.model, other.dt_s = plant.model_of_step(value), float(value)
        share = other.dt_s / plant.dt_s
        if len(settings.at_step(other.dt_s).steps) != len(settings.at_step(plant.dt_s).steps):
            raise ValueError(f"dt = {value:g}: two steps of the horizon would be one; choose a smaller dt")
        made = self._made(plant=other)
        made.__setstate__(self.__getstate__())
        made._limits[2] *= share
        if settings.tuned_at_dt_s is not None:
            made._Qu *= share
        if made._offset is not None:
            made._offset.past.clear()  # the states measured so far are not a new step apart
        self.__dict__ = vars(made)

    def __setattr__(self, name: str, value: Any) -> None:
        if not (name.startswith("_") or name in _SETTABLE):
            raise AttributeError(
                f"{name} of a {type(self).__name__} cannot be set; what can be is {', '.join(_SETTABLE)}"
            )
        super().__setattr__(name, value)

    def __reduce__(self) -> Any:
        return self._made, (), self.__getstate__()

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """A copy that goes on by itself; the plant, which keeps no state, is shared."""
        return copy(self)

    def __getstate__(self) -> tuple[Any, ...]:
        """All that a step changes or a user has set, as copies."""
        return (
            [array.copy() for array in self._changing],
            (self._started, self._moved, self._outputs.not_known.copy()),
            None if self._coupling is None else self._coupling.memory,
            None if self._offset is None else list(self._offset.past),
        )

    def __setstate__(self, memory: tuple[Any, ...]) -> None:
        arrays, (self._started, self._moved, self._outputs.not_known), of_coupling, past = memory
        for array, value in zip(self._changing, arrays, strict=True):
            array[:] = value
        if self._coupling is not None:
            self._coupling.memory = of_coupling
        if self._offset is not None:
            self._offset.past.extend(past)

    def _roll(self, state: Array, preview: Array, share: float) -> None:
        """Roll the points out without an update, drawn at a share of their distance."""
        law = self._law
        kept, law.spread[:] = law.spread.copy(), share
        self._roll_out.between(draw, None, law, *self._example)(state, preview, self._out)
        law.spread[:] = kept

    def _derive_P_err(self, state: Array, preview: Array) -> None:
        """Take P_err from what the initial Pu does to the outputs: by their slope at the start, or now."""
        law = self._law
        kept = law.control.copy(), law.Pu.copy()
        law.control[:], law.Pu[:] = self._initial, self._initial_Pu
        for share in (_OF_SLOPE, 1.0):
            for x, ahead in ((self.plant.initial_state(), np.zeros_like(preview)), (state, preview)):
                if self._outputs.not_known:
                    self._roll(x, ahead, share)
                    self._outputs.derive_error(law.of_roll_out, share)
        law.control[:], law.Pu[:] = kept


def of_shape(name: str, values: Array, shape: tuple[int, ...]) -> Array:
    if values.shape != shape:
        raise ValueError(f"{name} has shape {values.shape} instead of {shape}.")
    return values
