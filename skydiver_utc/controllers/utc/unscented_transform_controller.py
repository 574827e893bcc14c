# SPDX-License-Identifier: Apache-2.0
"""The Unscented Transform Controller, for any plant."""

from collections.abc import Callable, Sequence
from itertools import compress
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from typing_extensions import Self

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.protocol import Decision, Status
from skydiver_utc.controllers.utc.construction import plain
from skydiver_utc.controllers.utc.explanation import Explanation
from skydiver_utc.controllers.utc.law import Recovery
from skydiver_utc.controllers.utc.result import GROWN, UtcResult
from skydiver_utc.controllers.utc.settings import UtcSettings
from skydiver_utc.controllers.utc.tunable import Tunable, of_shape
from skydiver_utc.parameters.conversion import checked
from skydiver_utc.plants.function import FunctionPlant, numbers

# How fast a control goes, without feedback, to its value after the reference, as a share of its rate limit.
_SHARE_OF_RATE_AFTER_REFERENCE = 0.1
_STATUS, _KEPT_PREVIOUS = tuple(Status), int(Status.KEPT_PREVIOUS)


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
    Attributes: horizon: the last step that the law looks at; preview_steps, telemetry_names: those of a `Controller`

    A point that diverges inside the horizon is left out, and the weights of the others are scaled to the same sum. The
    previous control is kept if no point is left or the update is not finite; the next step then begins from the
    initial Pu.
    """

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

    def decide(self, state: Array, preview: Array) -> Decision:
        """Control for a state (n,) and the reference preview (preview_steps + 1, l)."""
        self._move_on(state, preview, None)
        return Decision(self._law.control.copy(), self._out[:-1].copy(), _STATUS[int(self._out[-1])])

    def step(self, state: ArrayLike, reference: ArrayLike, *, Qu: ArrayLike | None = None) -> UtcResult:
        """The control to apply until the next step, with what led to it.

        state: (n,), as measured now
        reference: the outputs wanted at the horizon, (l,) or one number; or a preview (preview_steps + 1, l)
        Qu: what is added to Pu in this step instead of the usual (m, m)
        A state or reference that is not finite keeps the control; a wrong shape is a ValueError.
        """
        (x, preview), before = self._checked(state, reference), self.control
        noise = None if Qu is None else of_shape("Qu", numbers("Qu", Qu), before.shape * 2)
        if self._are_finite(x, preview):
            self._move_on(x, preview, noise)
        else:
            self._law.innovation[:] = 0.0
            self._write(Status.KEPT_PREVIOUS)
            if self._offset is not None:
                self._offset.apply(x, self._law.control)
        return self._result(before)

    def _result(self, before: Array) -> UtcResult:
        law, of = self._law, self._outputs
        recovery, lost, status = map(int, self._out[-3:])
        columns = of.of_tracked.ravel()
        outputs, points, gone = law.outputs[:, columns], law.points.copy(), law.alive == 0.0
        outputs[gone], points[gone] = np.nan, np.nan
        return UtcResult(
            control=self.control,
            predicted=law.predicted[columns],
            innovation=law.innovation[columns],
            unit=np.sqrt(law.P_err.diagonal()[columns]),
            of_control=outputs[0] + law.offset[columns],
            mean_output=(law.Y + law.offset)[columns],
            sigma_points=points,
            outputs=outputs,
            gain=law.gain[:, columns],
            covariance=self.Pu,
            grown=self._grown(),
            repaired=float(self._out[-4]),
            lost=lost,
            cause=self._roll_out.cause,
            spread=float(law.spread[0]),
            unmoved=tuple(compress(of.names, law.unmoved)) if status == Status.NO_EFFECT else (),
            recovery=Recovery(recovery),
            status=Status(status),
            before=before,
            limits=self._limits.copy(),
        )

    def _grown(self) -> tuple[str, ...]:
        """Controls whose sigma points lie on both bounds, or, without bounds, far beyond those at the start."""
        spans = self._limits[1] - self._limits[0]
        most = np.where(np.isfinite(spans), (0.5 * spans) ** 2, GROWN * self._initial_Pu.diagonal())
        return tuple(
            self.plant.control_names[c]
            for c in np.flatnonzero((self._law.Pu.diagonal() > most) & (spans > 0.0))
        )

    def explain(self, state: ArrayLike, reference: ArrayLike) -> Explanation:
        """Which control moves which output at the horizon, from a state (n,); nothing is changed by it.

        reference: as in `step`
        """
        x, preview = self._checked(state, reference)
        self._derive_P_err(x, preview)
        law, of = self._law, self._outputs
        self._roll(x, preview, 1.0)
        last = of.of_tracked[-1]
        saved, outputs = law.saved.copy(), law.of_roll_out[:, last]
        alive = np.isfinite(law.of_roll_out).all(axis=1)
        beside = of.differences(outputs - outputs[np.argmax(alive)], last)
        distance = of.differences(law.reference[last] - law.offset[last] - outputs[0], last)
        deviation = np.sqrt(np.maximum(law.Pu.diagonal(), 0.0))
        slopes = np.linalg.lstsq(saved[alive] - saved[np.argmax(alive)], beside[alive], rcond=1e-9)[0]
        minimum, maximum, _ = self._limits
        return Explanation(
            controls=self.plant.control_names,
            outputs=of.tracked,
            horizon=self.horizon,
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
        return self._roll_out.paths(state, preview, steps)

    def _move_on(self, state: Array, preview: Array, Qu: Array | None) -> None:
        """One step of the law, with the offset of the outputs before it; what led to it stands in `_out`."""
        if self._offset is None:
            self._step(state, preview, Qu)
        else:
            self._offset.measure(state)
            self._step(state, preview, Qu)
            self._offset.apply(state, self._law.control)

    def _step(self, state: Array, preview: Array, Qu: Array | None) -> None:
        if self.settings.after_reference:
            self._moved = self._moved or bool(preview[0].any())
            if self._moved and not preview.any():
                rate = _SHARE_OF_RATE_AFTER_REFERENCE * self._limits[2]
                wanted, control = np.clip(self._after, self._limits[0], self._limits[1]), self._law.control
                control[:] = np.clip(wanted, control - rate, control + rate)
                self._write(Status.SOLVED)
                return
        if not self._started:
            self._law.Pu[:] = self._first_Pu(preview)
            self._started = True
        if Qu is None:
            of = self._coupling
            Qu = self._Qu if of is None else of.process_noise(preview[:, 0], self._law.control)
        if self._outputs.not_known:
            self._derive_P_err(state, preview)
        self._law.Qu[:] = Qu
        self._run(state, preview, self._out)
        if self._out[-1] == _KEPT_PREVIOUS:
            self._law.innovation[:] = 0.0
            if self._are_finite(state, preview):
                # It could fail again and again.
                self._law.Pu[:] = self._first_Pu(preview)
                self._write(Status.KEPT_PREVIOUS, self._out[-4], Recovery.RESTARTED, self._out[-2])
            else:
                self._write(Status.KEPT_PREVIOUS)

    def _write(
        self, status: Status, repaired: float = 0.0, recovery: Recovery = Recovery.NONE, lost: float = 0.0
    ) -> None:
        """Write `_out` of a step in which the law moved nothing."""
        law, l = self._law, len(self._outputs.tracked)
        deviations = np.sqrt(np.maximum(law.Pu.diagonal(), 0.0))
        self._out[:-4] = np.concatenate([law.predicted[:l], law.innovation[:l], deviations])
        self._out[-4:] = repaired, recovery, lost, status

    def _first_Pu(self, preview: Array) -> Array:
        """Pu at a run's first step; with a coupling its signs are those of the reference."""
        return (
            self._initial_Pu if self._coupling is None else self._coupling.initial_covariance(preview[:, 0])
        )

    def _checked(self, state: ArrayLike, reference: ArrayLike) -> tuple[Array, Array]:
        """State (n,) and preview (preview_steps + 1, l); raises ValueError for other shapes and what is no number."""
        x = of_shape("state", np.atleast_1d(numbers("state", state)), self._example[0].shape)
        wanted = numbers("reference", reference)
        rows, l = self.preview_steps + 1, len(self._outputs.tracked)
        if wanted.ndim <= 1 and wanted.size == l:
            return x, np.tile(wanted.reshape(1, l), (rows, 1))
        if wanted.shape == (rows,) and l == 1:
            return x, np.ascontiguousarray(wanted.reshape(rows, 1))
        if wanted.shape != (rows, l):
            raise ValueError(
                f"reference has shape {wanted.shape}; give the outputs wanted at the horizon, ({l},),"
                f" or a preview, ({rows}, {l})."
            )
        return x, np.ascontiguousarray(wanted)

    def _are_finite(self, state: Array, preview: Array) -> bool:
        return bool(np.isfinite(state).all() and np.isfinite(preview[: self.horizon + 1]).all())
