# SPDX-License-Identifier: Apache-2.0
"""The Unscented Transform Controller, for any plant."""

from collections.abc import Callable, Sequence
from itertools import compress
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from typing_extensions import Self

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.limits import limits_of
from skydiver_utc.controllers.protocol import DIVERGED_POINTS, Decision, Status
from skydiver_utc.controllers.utc.construction import (
    check_names,
    control_after_reference,
    dynamics_of,
    initial_covariance,
    law_of,
    plain,
)
from skydiver_utc.controllers.utc.coupling import CouplingSchedule
from skydiver_utc.controllers.utc.explanation import Explanation
from skydiver_utc.controllers.utc.horizon_outputs import HorizonOutputs
from skydiver_utc.controllers.utc.law import Recovery, draw, update
from skydiver_utc.controllers.utc.output_offset import OutputOffset
from skydiver_utc.controllers.utc.result import GROWN, UtcResult
from skydiver_utc.controllers.utc.settings import UtcSettings, matrix
from skydiver_utc.controllers.utc.tunable import Tunable
from skydiver_utc.parameters.conversion import checked
from skydiver_utc.plants.function import FunctionPlant, numbers
from skydiver_utc.plants.protocol import Plant

# How fast a control goes to its value after the reference, as a share of its rate limit, so that nothing jerks.
_SHARE_OF_RATE_AFTER_REFERENCE = 0.1
_STATUS, _RECOVERY = tuple(Status), tuple(Recovery)
_KEPT_PREVIOUS = int(Status.KEPT_PREVIOUS)


class UnscentedTransformController(Tunable):
    """Moves a control U (m,) so that the plant's outputs Y (l,), N steps ahead, meet their reference.

    eq:sigp          U^i = U, U +- sqrt(m / (1 - W0)) S_j,  S S = Pu,  i = 0 .. 2m, inside the bounds
    eq:zpred         Y^i = outputs of the model N steps ahead under U^i;  Y = sum W^i Y^i
    eq:xpred, pu_pred    U- = sum W^i U^i,  Pu- = Qu + sum W^i (U^i - U-)(U^i - U-)'
    eq:utc_controller    C_y = P_err + sum W^i (Y^i - Y)(Y^i - Y)',  C_uy = sum W^i (U^i - U-)(Y^i - Y)'
                     K = C_uy C_y^-1
                     U = U- + K (reference - Y), inside bounds and rates
                     Pu = Pu- - K C_y K'

    settings: `UtcSettings`; plant: offers model, limits and names; outputs: names of the outputs that the reference is
    for, all of the plant's without; dt_s: that of the plant
    dynamics: dynamics(point (m,), control (m,) before, state (n,), preview (N+1, l), j) -> control (m,) on step
        j of the horizon, plain or jitted; U^i of eq:xpred is then the control on the first step. None: as in settings
    A setting that does not fit the plant is a ValueError. For a plant that is a function, `of` makes all of it.

    A point that diverges inside the horizon is left out, and the weights of the others are scaled to the same sum. The
    previous control is kept if no point is left or the update is not finite; the next step then begins from the
    initial Pu.
    """

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
        self._make(settings, plant, outputs, dynamics)

    def _make(
        self,
        settings: UtcSettings,
        plant: Plant,
        outputs: tuple[str, ...],
        dynamics: Callable[..., Any] | None,
    ) -> None:
        outputs = outputs or plant.output_names
        self._made_of = settings, plant, outputs, dynamics
        settings = settings.at_step(plant.dt_s)
        controls, m = plant.control_names, len(plant.control_names)
        check_names(settings, plant)
        self._names = controls
        self._steps, self._l = settings.steps, len(outputs)
        self._limits = limits_of(plant)
        self._initial = plant.initial_control()
        self._after = control_after_reference(settings, plant)
        self._holds_after = bool(settings.after_reference)

        variances = initial_covariance(settings, self._limits, controls)
        self._initial_Pu = variances
        self._Qu = (
            settings.Qu_ratio * variances if settings.Qu is None else matrix("Qu", settings.Qu, controls)
        )
        self._coupling: CouplingSchedule | None = None
        if settings.coupling is not None:
            self._coupling = CouplingSchedule(
                settings.coupling, variances, controls, settings.Qu_ratio, plant.dt_s
            )

        self._outputs = found = HorizonOutputs(settings, plant, outputs)
        inside = dynamics_of(settings, plant, outputs, dynamics)
        self._law, self._roll_out = law_of(settings, plant, found, self._limits, inside, variances)
        self._preview_steps, law = settings.preview_steps(plant.dt_s), self._law
        self._offset: OutputOffset | None = None
        if settings.offset_share > 0.0:
            self._offset = OutputOffset(plant, found, self._steps, settings.offset_share, law.offset)
        self._n = plant.model.state_size
        self._out = np.empty(2 * self._l + m + 3)
        self._example = np.empty(self._n), np.empty((1, self._l)), self._out
        self._run = self._roll_out.between(draw, update, law, *self._example)
        self.__dict__.pop("_roll", None)
        self._telemetry_names = (
            *(f"predicted_{name}" for name in outputs),
            *(f"innovation_{name}" for name in outputs),
            *(f"std_{name}" for name in controls),
            "repaired_covariance",
            "recovery",
            DIVERGED_POINTS,
        )
        self.reset()

    @classmethod
    def of(
        cls,
        plant: Callable[..., Any],
        output: Callable[[Array], Any] | None = None,
        *,
        state: ArrayLike,
        control: ArrayLike,
        dt: float,
        horizon: int | Sequence[int],
        minimum: ArrayLike = -np.inf,
        maximum: ArrayLike = np.inf,
        rate: ArrayLike = np.inf,
        dynamics: Callable[..., Any] | None = None,
        **settings: Any,
    ) -> Self:
        """A controller of a plant that is given as a function.

        plant .. rate: as in `FunctionPlant`; dynamics: as in the class; horizon: `horizon_steps` of `UtcSettings`, and
        settings: its other fields, in which states, controls and outputs are x0 .., u0 .., y0 ..
        Whatever cannot be used is a ValueError that names it.
        """
        given = {name: plain(value) for name, value in settings.items()} | {"horizon_steps": plain(horizon)}
        own = FunctionPlant(
            plant, output, state=state, control=control, dt=dt, minimum=minimum, maximum=maximum, rate=rate
        )
        return cls(checked(UtcSettings, given), own, dynamics=dynamics)

    def reset(self, control: ArrayLike | None = None, Pu: ArrayLike | None = None) -> None:
        """Start again from the plant's initial control (m,) and the initial covariance (m, m), or from others.

        One number is for all controls. Raises ValueError for other shapes and what is no number.
        """
        m = len(self._names)
        start = self._initial if control is None else numbers("control", control)
        start = _of_shape("control", np.full(m, start) if start.ndim == 0 else start, (m,))
        covariance = None if Pu is None else _of_shape("Pu", np.atleast_2d(numbers("Pu", Pu)), (m, m))
        self.resume(start)
        self._moved = False
        if covariance is not None:
            self._begin_from(covariance)
            self._started = True

    def resume(self, control: Array) -> None:
        """Start from this control (m,), the one applied last, with Pu as at a run's first step.

        Whether the reference has moved already is not known then; a control nearer to that after it says so.
        """
        self._law.control[:] = np.clip(control, self._limits[0], self._limits[1])
        self._law.predicted[:], self._law.innovation[:] = 0.0, 0.0
        self._begin_from(self._initial_Pu)
        self._law.spread[:], self._law.watch[:], self._law.singly[:] = 1.0, np.inf, False
        if self._offset is not None:
            self._offset.reset()
        if self._coupling is not None:
            self._coupling.reset()
        self._started = self._coupling is None
        self._moved = bool(np.linalg.norm(control - self._after) < np.linalg.norm(control - self._initial))

    def decide(self, state: Array, preview: Array) -> Decision:
        """Control for a state (n,) and the reference preview (preview_steps + 1, l)."""
        status, _, _ = self._moved_on(state, preview, None)
        return Decision(self._law.control.copy(), self._out.copy(), status)

    def step(self, state: ArrayLike, reference: ArrayLike, *, Qu: ArrayLike | None = None) -> UtcResult:
        """The control to apply until the next step, with what led to it.

        state: (n,), as measured now
        reference: the outputs wanted at the horizon, (l,) or one number; or a preview (preview_steps + 1, l)
        Qu: what is added to Pu in this step instead of the usual (m, m)
        A state or reference that is not finite keeps the control; a wrong shape is a ValueError.
        """
        (x, preview), before = self._checked(state, reference), self.control
        noise = None if Qu is None else _of_shape("Qu", numbers("Qu", Qu), before.shape * 2)
        if self._are_finite(x, preview):
            status, recovery, lost = self._moved_on(x, preview, noise)
        else:
            self._law.innovation[:] = 0.0
            status, recovery, lost = self._without_update(Status.KEPT_PREVIOUS)
            if self._offset is not None:
                self._offset.apply(x, self._law.control)
        return self._result(status, recovery, lost, before)

    def _result(self, status: Status, recovery: Recovery, lost: int, before: Array) -> UtcResult:
        law, of = self._law, self._outputs
        columns = of.of_tracked.ravel()
        outputs, points, gone = law.outputs[:, columns], law.points.copy(), law.alive == 0.0
        outputs[gone], points[gone] = np.nan, np.nan
        return UtcResult(
            control=self.control,
            predicted=law.predicted[columns],
            innovation=law.innovation[columns],
            unit=np.sqrt(law.P_err.diagonal()[columns]),
            of_control=outputs[0] + law.offset[columns],
            mean_output=law.mean[columns],
            sigma_points=points,
            outputs=outputs,
            gain=law.gain[:, columns],
            covariance=self.Pu,
            grown=self._grown(),
            repaired=float(self._out[-3]),
            lost=lost,
            cause=self._roll_out.cause,
            spread=float(law.spread[0]),
            unmoved=tuple(compress(of.names, law.unmoved)) if status is Status.NO_EFFECT else (),
            recovery=recovery,
            status=status,
            before=before,
            limits=self._limits.copy(),
        )

    def _grown(self) -> tuple[str, ...]:
        """Controls whose sigma points lie on both bounds, or, without bounds, far beyond those at the start."""
        spans = self._limits[1] - self._limits[0]
        most = np.where(np.isfinite(spans), (0.5 * spans) ** 2, GROWN * self._initial_Pu.diagonal())
        return tuple(self._names[c] for c in np.flatnonzero((self._law.Pu.diagonal() > most) & (spans > 0.0)))

    def explain(self, state: ArrayLike, reference: ArrayLike) -> Explanation:
        """Which control moves which output at the horizon, from a state (n,); nothing is changed by it.

        reference: as in `step`
        """
        x, preview = self._checked(state, reference)
        if self._outputs.not_known:
            self._derive_P_err(x, preview)
        law, of = self._law, self._outputs
        kept, law.spread[:] = law.spread.copy(), 1.0
        self._roll(x, preview, self._out)
        law.spread[:] = kept
        last = of.of_tracked[-1]
        saved, outputs = law.saved.copy(), law.of_roll_out[:, last]
        alive = np.isfinite(law.of_roll_out).all(axis=1)
        beside = of.differences(outputs - outputs[np.argmax(alive)], last)
        distance = of.differences(law.reference[last] - law.offset[last] - outputs[0], last)
        deviation = np.sqrt(np.maximum(self._law.Pu.diagonal(), 0.0))
        slopes = np.linalg.lstsq(saved[alive] - saved[np.argmax(alive)], beside[alive], rcond=1e-9)[0]
        minimum, maximum, _ = self._limits
        return Explanation(
            controls=self._names,
            outputs=of.tracked,
            horizon=self._steps[-1],
            control=self.control,
            minimum=minimum.copy(),
            maximum=maximum.copy(),
            deviation=deviation,
            moves=deviation[:, np.newaxis] * slopes,
            unit=np.sqrt(law.P_err.diagonal()[last]),
            distance=distance,
            clipped=((law.points == minimum) | (law.points == maximum)).sum(axis=0),
            diverged=int((~alive).sum()),
            cause=self._roll_out.cause,
        )

    def look_ahead(self, state: Array, preview: Array, steps: int) -> tuple[Array, Array]:
        """The model's path from a state (n,) within some steps; nothing is changed by it.

        States (2m+1, steps + 1, n) and the last controls (2m+1, m): row 0 under the control in force, the others under
        the sigma points of the last step. preview (steps + preview_steps + 1, l)
        """
        self._law.points[0] = self._law.control
        return self._roll_out.states(self.plant.bound_model, state, preview, steps)

    @property
    def horizon(self) -> int:
        """The last step that the law looks at."""
        return self._steps[-1]

    def _moved_on(self, state: Array, preview: Array, Qu: Array | None) -> tuple[Status, Recovery, int]:
        """One step of the law, with the offset of the outputs before it."""
        if self._offset is None:
            return self._step(state, preview, Qu)
        self._offset.measure(state)
        found = self._step(state, preview, Qu)
        self._offset.apply(state, self._law.control)
        return found

    def _step(self, state: Array, preview: Array, Qu: Array | None) -> tuple[Status, Recovery, int]:
        """One step of the law: status, recovery, lost points; the rest stands in `_out`."""
        if self._holds_after:
            self._moved = self._moved or bool(preview[0].any())
            if self._moved and not preview.any():
                self._hold_after_reference()
                return self._without_update(Status.SOLVED)
        if not self._started:
            self._begin_from(self._first_Pu(preview))
            self._started = True
        if Qu is None:
            of = self._coupling
            Qu = self._Qu if of is None else of.process_noise(preview[:, 0], self._law.control)
        if self._outputs.not_known:
            self._derive_P_err(state, preview)
        self._law.Qu[:] = Qu
        self._run(state, preview, self._out)
        status, recovery, lost = self._law.events.tolist()
        if status == _KEPT_PREVIOUS:
            self._law.innovation[:] = 0.0
            if not self._are_finite(state, preview):
                return self._without_update(Status.KEPT_PREVIOUS)
            # It could fail again and again.
            self._begin_from(self._first_Pu(preview))
            return self._without_update(Status.KEPT_PREVIOUS, Recovery.RESTARTED, lost, self._out[-3])
        return _STATUS[status], _RECOVERY[recovery], lost

    def _without_update(
        self, status: Status, recovery: Recovery = Recovery.NONE, lost: int = 0, repaired: float = 0.0
    ) -> tuple[Status, Recovery, int]:
        """The result of a step in which the law moved nothing."""
        out, l = self._out, self._l
        out[:l], out[l : 2 * l] = self._law.predicted[:l], self._law.innovation[:l]
        out[2 * l : -3] = np.sqrt(np.maximum(self._law.Pu.diagonal(), 0.0))
        out[-3:] = repaired, recovery, lost
        return status, recovery, lost

    def _first_Pu(self, preview: Array) -> Array:
        """Pu at a run's first step; with a coupling its signs are those of the reference."""
        return (
            self._initial_Pu if self._coupling is None else self._coupling.initial_covariance(preview[:, 0])
        )

    def _begin_from(self, Pu: Array) -> None:
        self._law.Pu[:] = Pu

    def _hold_after_reference(self) -> None:
        """Move to the controls after the reference, at a share of their rate limit; no feedback."""
        rate = _SHARE_OF_RATE_AFTER_REFERENCE * self._limits[2]
        wanted = np.clip(self._after, self._limits[0], self._limits[1])
        self._law.control[:] = np.clip(wanted, self._law.control - rate, self._law.control + rate)

    def _checked(self, state: ArrayLike, reference: ArrayLike) -> tuple[Array, Array]:
        """State (n,) and preview (preview_steps + 1, l); raises ValueError for other shapes and what is no number."""
        x = _of_shape("state", np.atleast_1d(numbers("state", state)), (self._n,))
        return x, self._preview(numbers("reference", reference))

    def _are_finite(self, state: Array, preview: Array) -> bool:
        return bool(np.isfinite(state).all() and np.isfinite(preview[: self._steps[-1] + 1]).all())

    def _preview(self, reference: Array) -> Array:
        """The reference (preview_steps + 1, l) at the steps 0, 1, ..."""
        rows = self._preview_steps + 1
        if reference.ndim <= 1 and reference.size == self._l:
            return np.tile(reference.reshape(1, self._l), (rows, 1))
        if reference.shape == (rows,) and self._l == 1:
            return np.ascontiguousarray(reference.reshape(rows, 1))
        if reference.shape != (rows, self._l):
            raise ValueError(
                f"reference has shape {reference.shape}; give the outputs wanted at the horizon, ({self._l},),"
                f" or a preview, ({rows}, {self._l})."
            )
        return np.ascontiguousarray(reference)


def _of_shape(name: str, values: Array, shape: tuple[int, ...]) -> Array:
    if values.shape != shape:
        raise ValueError(f"{name} has shape {values.shape} instead of {shape}.")
    return values
