# SPDX-License-Identifier: Apache-2.0
"""The Unscented Transform Controller, for any plant."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import Self

from skydiver_utc.controllers.limits import limits_of
from skydiver_utc.controllers.protocol import Decision, Status
from skydiver_utc.controllers.roll_out import Dynamics, RollOut
from skydiver_utc.controllers.utc.coupling import CouplingSchedule
from skydiver_utc.controllers.utc.dynamics import incremental, user_dynamics
from skydiver_utc.controllers.utc.law import Law, Recovery, draw, update
from skydiver_utc.controllers.utc.result import UtcResult
from skydiver_utc.controllers.utc.settings import UtcSettings, matrix
from skydiver_utc.parameters.conversion import checked
from skydiver_utc.plants.function import FunctionPlant, numbers
from skydiver_utc.plants.protocol import Plant
from skydiver_utc.unscented.sigma_points import weights

Array = NDArray[np.float64]
# How fast a control goes to its value after the reference, as a share of its rate limit, so that nothing jerks.
_SHARE_OF_RATE_AFTER_REFERENCE = 0.1
_STATUS, _RECOVERY = tuple(Status), tuple(Recovery)
_KEPT_PREVIOUS = int(Status.KEPT_PREVIOUS)


class UnscentedTransformController:
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
        outputs = outputs or plant.output_names
        controls, m = plant.control_names, len(plant.control_names)
        for block, names in (
            ("outputs", plant.output_names),
            ("nominal", controls),
            ("after_reference", controls),
        ):
            for name in getattr(settings, block):
                if name not in names:
                    raise ValueError(f"{block}.{name}: the plant has {', '.join(names)}")
        self._steps, self._l = settings.steps, len(outputs)
        self._limits = limits_of(plant)
        self._initial = plant.initial_control()
        self._after = self._initial.copy()
        for name, value in settings.after_reference.items():
            self._after[controls.index(name)] = self._inside(
                f"after_reference.{name}", value, controls.index(name)
            )
        self._holds_after = bool(settings.after_reference)

        variances = self._variances(settings, controls)
        self._initial_Pu = variances
        self._Qu = (
            settings.Qu_ratio * variances if settings.Qu is None else matrix("Qu", settings.Qu, controls)
        )
        smallest = 1e-9 * float(np.diag(variances).min())
        floor = smallest if settings.covariance_floor is None else settings.covariance_floor
        self._coupling: CouplingSchedule | None = None
        if settings.coupling is not None:
            self._coupling = CouplingSchedule(
                settings.coupling, variances, controls, settings.Qu_ratio, plant.dt_s
            )

        tracked = matrix("P_err", settings.P_err, outputs)
        if not np.linalg.eigvalsh(tracked)[0] > 0.0:
            raise ValueError("P_err must be positive definite")
        further = [plant.output_names.index(name) for name in settings.outputs]
        nominal = np.array([controls.index(name) for name in settings.nominal], dtype=np.int64)
        self._count = self._l + len(further)
        of_step = np.diag([0.0] * self._l + [output.P_err for output in settings.outputs.values()])
        of_step[: self._l, : self._l] = tracked
        size = self._count * len(self._steps)
        self._P_err = np.zeros((size + len(nominal),) * 2)
        self._P_err[:size, :size] = np.kron(np.eye(len(self._steps)), of_step)
        self._reference = np.empty(len(self._P_err))
        for k, output in enumerate(settings.outputs.values()):
            self._reference[self._l + k : size : self._count] = output.reference
        for k, (name, drawn) in enumerate(settings.nominal.items()):
            self._P_err[size + k, size + k] = drawn.variance
            self._reference[size + k] = self._inside(f"nominal.{name}", drawn.value, controls.index(name))

        inside = self._dynamics_of(settings, plant, outputs, dynamics)
        as_drawn = inside is None or (
            dynamics is None and settings.dynamics is not None and settings.dynamics.saved == "drawn"
        )
        self.preview_steps = settings.preview_steps(plant.dt_s)
        selected = [plant.output_names.index(name) for name in outputs] + further
        self._roll_out = RollOut(
            plant.model, len(plant.output_names), self._steps, selected, self._limits, (2 * m + 1, m), inside
        )
        at, L = self._roll_out, len(self._P_err)
        self._control, self._Pu = at.applied, variances.copy()
        self._predicted, self._innovation = np.zeros(L), np.zeros(L)
        self._Qu_now, self._events = self._Qu.copy(), np.zeros(3, dtype=np.int64)
        law = Law(
            np.array(self._steps), at.points, at.outputs, weights(m, settings.W0), settings.W0, floor,
            1.0 - settings.forgetting_factor, self._limits, self._P_err, self._Qu_now, nominal, self._l, self._count,
            settings.aim == "tangent", np.zeros((2 * m + 1, L)) if len(nominal) else at.outputs,
            at.points if as_drawn else at.first, self._reference, self._predicted, self._innovation,
            self._control, self._Pu, np.empty((m, m)), self._events,
        )  # fmt: skip
        self._n = plant.model.state_size
        self._out = np.empty(2 * self._l + m + 2)
        self._run = at.between(draw, update, law, np.empty(self._n), np.empty((1, self._l)), self._out)
        self.telemetry_names: tuple[str, ...] = (
            *(f"predicted_{name}" for name in outputs),
            *(f"innovation_{name}" for name in outputs),
            *(f"std_{name}" for name in controls),
            "repaired_covariance",
            "recovery",
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
        given = {name: _plain(value) for name, value in settings.items()} | {"horizon_steps": _plain(horizon)}
        own = FunctionPlant(
            plant, output, state=state, control=control, dt=dt, minimum=minimum, maximum=maximum, rate=rate
        )
        return cls(checked(UtcSettings, given), own, dynamics=dynamics)

    def reset(self, control: ArrayLike | None = None, Pu: ArrayLike | None = None) -> None:
        """Start again from the plant's initial control and the initial covariance, or from others."""
        self.resume(self._initial if control is None else np.array(control, dtype=float))
        self._moved = False
        if Pu is not None:
            self._begin_from(np.array(Pu, dtype=float))
            self._started = True

    def resume(self, control: Array) -> None:
        """Start from this control (m,), the one applied last, with Pu as at a run's first step.

        Whether the reference has moved already is not known then; a control nearer to that after it says so.
        """
        self._control[:] = np.clip(control, self._limits[0], self._limits[1])
        self._predicted[:], self._innovation[:] = 0.0, 0.0
        self._begin_from(self._initial_Pu)
        if self._coupling is not None:
            self._coupling.reset()
        self._started = self._coupling is None
        self._moved = self._holds_after and bool(
            np.linalg.norm(control - self._after) < np.linalg.norm(control - self._initial)
        )

    def decide(self, state: Array, preview: Array) -> Decision:
        """Control for a state (n,) and the reference preview (preview_steps + 1, l)."""
        status, _, _ = self._step(state, preview, None)
        return Decision(self._control.copy(), self._out.copy(), status)

    def step(self, state: ArrayLike, reference: ArrayLike, *, Qu: ArrayLike | None = None) -> UtcResult:
        """The control to apply until the next step, with what led to it.

        state: (n,), as measured now
        reference: the outputs wanted at the horizon, (l,) or one number; or a preview (preview_steps + 1, l)
        Qu: what is added to Pu in this step instead of the usual (m, m)
        A state or reference that is not finite keeps the control; a wrong shape is a ValueError.
        """
        x, before = np.atleast_1d(numbers("state", state)), self.control
        if x.shape != (self._n,):
            raise ValueError(f"state has shape {x.shape} instead of ({self._n},).")
        preview = self._preview(numbers("reference", reference))
        noise = None if Qu is None else numbers("Qu", Qu)
        if noise is not None and noise.shape != before.shape * 2:
            raise ValueError(f"Qu has shape {noise.shape} instead of {before.shape * 2}.")
        if _finite(x, preview[: self._steps[-1] + 1]):
            status, recovery, lost = self._step(x, preview, noise)
        else:
            self._innovation[:] = 0.0
            status, recovery, lost = self._without_update(Status.KEPT_PREVIOUS)
        return UtcResult(
            control=self.control,
            predicted=self._predicted[: self._l * len(self._steps)].copy(),
            innovation=self._innovation[: self._l * len(self._steps)].copy(),
            covariance=self.Pu,
            repaired=float(self._out[-2]),
            lost=lost,
            cause=self._roll_out.cause,
            recovery=recovery,
            status=status,
            before=before,
            limits=self._limits,
        )

    @property
    def control(self) -> Array:
        """The control now in force (m,), a copy."""
        return self._control.copy()

    @property
    def Pu(self) -> Array:
        """The covariance of the control now (m, m), a copy."""
        return self._Pu.copy()

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
            Qu = (
                self._Qu
                if self._coupling is None
                else self._coupling.process_noise(preview[:, 0], self._control)
            )
        self._Qu_now[:] = Qu
        self._run(state, preview, self._out)
        status, recovery, lost = self._events.tolist()
        if status == _KEPT_PREVIOUS:
            self._innovation[:] = 0.0
            if not _finite(state, preview[: self._steps[-1] + 1]):
                return self._without_update(Status.KEPT_PREVIOUS)
            # It could fail again and again.
            self._begin_from(self._first_Pu(preview))
            return self._without_update(Status.KEPT_PREVIOUS, Recovery.RESTARTED, lost, self._out[-2])
        return _STATUS[status], _RECOVERY[recovery], lost

    def _without_update(
        self, status: Status, recovery: Recovery = Recovery.NONE, lost: int = 0, repaired: float = 0.0
    ) -> tuple[Status, Recovery, int]:
        """The result of a step in which the law moved nothing."""
        out, l = self._out, self._l
        out[:l], out[l : 2 * l] = self._predicted[:l], self._innovation[:l]
        out[2 * l : -2] = np.sqrt(np.maximum(self._Pu.diagonal(), 0.0))
        out[-2:] = repaired, recovery
        return status, recovery, lost

    def _first_Pu(self, preview: Array) -> Array:
        """Pu at a run's first step; with a coupling its signs are those of the reference."""
        return (
            self._initial_Pu if self._coupling is None else self._coupling.initial_covariance(preview[:, 0])
        )

    def _begin_from(self, Pu: Array) -> None:
        self._Pu[:] = Pu

    def _hold_after_reference(self) -> None:
        """Move to the controls after the reference, at a share of their rate limit; no feedback."""
        rate = _SHARE_OF_RATE_AFTER_REFERENCE * self._limits[2]
        wanted = np.clip(self._after, self._limits[0], self._limits[1])
        self._control[:] = np.clip(wanted, self._control - rate, self._control + rate)

    def _variances(self, settings: UtcSettings, controls: tuple[str, ...]) -> Array:
        if settings.Pu is not None:
            variances = matrix("Pu", settings.Pu, controls)
            if not (np.diag(variances) > 0.0).all():
                raise ValueError(
                    "Pu has a variance of zero: that control would never be tried; give it a small one"
                )
            return variances
        spans = self._limits[1] - self._limits[0]
        if not (np.isfinite(spans) & (spans > 0.0)).all():
            raise ValueError("Pu is needed, because not every control has a finite range to take it from")
        return np.diag((0.1 * spans) ** 2)

    def _inside(self, name: str, value: float, c: int) -> float:
        low, high = self._limits[0, c], self._limits[1, c]
        if not low <= value <= high:
            raise ValueError(
                f"{name} is {value:g}, outside the limits {low:g} .. {high:g} of the control: change one"
            )
        return value

    @staticmethod
    def _dynamics_of(
        settings: UtcSettings, plant: Plant, outputs: tuple[str, ...], own: Callable[..., Any] | None
    ) -> Dynamics | None:
        """What a sigma point does inside the horizon."""
        if own is not None:
            return user_dynamics(own, plant)
        if settings.dynamics is None:
            return None
        d = settings.dynamics
        if d.control not in plant.control_names:
            raise ValueError(
                f"dynamics.control: there is no {d.control}, the plant has {', '.join(plant.control_names)}"
            )
        tau = round(d.tau_s / plant.dt_s)
        at = plant.control_names.index(d.control), plant.output_names.index(outputs[0])
        return Dynamics(incremental, np.array([*at, d.K_p, d.K_FF, tau], dtype=float), True)

    def _preview(self, reference: Array) -> Array:
        """The reference (preview_steps + 1, l) at the steps 0, 1, ..."""
        rows = self.preview_steps + 1
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


def _plain(value: Any) -> Any:
    """Arrays of NumPy as numbers and rows, which settings hold."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, dict):
        return {name: _plain(item) for name, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


def _finite(state: Array, preview: Array) -> bool:
    return bool(np.isfinite(state).all() and np.isfinite(preview).all())
