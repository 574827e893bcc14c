# SPDX-License-Identifier: Apache-2.0
"""The paper's law, transcribed line by line, with the variants of its equations that the text allows or prints.

A controller like every other: ``kind: skydiver_utc.studies.paper_variants:PaperController``. Without variants it gives
the controls of the package's UTC; it is for the paper's skydiver, one output tracked, and not for speed.
"""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.limits import limited, limits_of
from skydiver_utc.controllers.protocol import Decision, Status
from skydiver_utc.controllers.roll_out import Dynamics, RollOut
from skydiver_utc.controllers.utc.law import ROUNDING
from skydiver_utc.controllers.utc.settings import Coupling, ProportionalDynamics
from skydiver_utc.jit import program
from skydiver_utc.parameters.fields import SlotSettings, quantity, text
from skydiver_utc.plants.protocol import Plant

KIND = "skydiver_utc.studies.paper_variants:PaperController"
Variant = Literal[
    "indefinite_covariance", "unsigned_s14", "no_hysteresis", "always_ahead", "saved_at_horizon", "positional",
    "printed_weights", "moved_after_bounds", "measured_before",
]  # fmt: skip


@program
def alpha_dynamics(
    point: Array, before: Array, state: Array, y: Array, y_before: Array, preview: Array, j: int,
    numbers: Array, out: Array,
) -> None:  # fmt: skip
    """eq:m1utc, or the positional law of the block diagram, on [t_k+j, t_k+j+1); see `roll_out.Dynamics`.

    numbers: which control, which output, K_p, K_FF, tau [steps], 1 for positional, and what the output counts as one
    step before the horizon (NaN: as at its start)
    """
    c, output, K_p, K_FF, tau = int(numbers[0]), int(numbers[1]), numbers[2], numbers[3], int(numbers[4])
    for a in range(out.shape[0]):
        out[a] = point[a]
    ahead = j + 1 + tau
    if numbers[5] > 0.0:
        out[c] = K_p * (preview[j + 1, 0] - y[output]) + K_FF * preview[ahead, 0]
        return
    last = y_before[output]
    if j == 0 and abs(numbers[6]) < np.inf:
        last = numbers[6]
    own = point[c] if j == 0 else before[c]
    change = preview[j + 1, 0] - preview[j, 0]
    change_ahead = preview[ahead, 0] - preview[ahead - 1, 0]
    out[c] = own + K_p * change - K_p * (y[output] - last) + K_FF * change_ahead


class PaperController:
    """UTC as the paper has it: one output, the coupling of a turning skydiver, alpha held or with dynamics."""

    class Settings(SlotSettings):
        """The fields of UTC's settings that the paper knows, and which variants are flown."""

        kind: str = KIND
        variants: Annotated[tuple[Variant, ...], text("variants of the equations")] = ()
        horizon_steps: Annotated[int, quantity("steps", "prediction horizon", ge=1, le=500)]
        W0: Annotated[float, quantity("1", "weight of the central sigma point", ge=0, lt=1)]
        P_err: Annotated[float, quantity("output^2", "covariance of the tracking error", gt=0)]
        Pu: Annotated[dict[str, Annotated[float, Field(gt=0)]], text("variance of each control at k = 0")]
        Qu_ratio: Annotated[float, quantity("1", "Qu as a share of Pu at k = 0", ge=0)]
        tuned_at_dt_s: Annotated[
            float | None, text("step of these numbers [s]; they are taken as they are")
        ] = None
        covariance_floor: Annotated[float, quantity("control^2", "smallest eigenvalue of Pu", ge=0)]
        coupling: Coupling
        dynamics: ProportionalDynamics | None = None

    def __init__(
        self, settings: Settings, plant: Plant, outputs: tuple[str, ...], dt_s: float, seed: int = 0
    ) -> None:
        if len(outputs) != 1:
            raise ValueError("the paper's law tracks one output")
        coupling, inside = settings.coupling, settings.dynamics
        if (
            coupling.alpha_sign != "reference"
            or coupling.full_acceleration > 0.0
            or (inside and inside.saved != "first_step")
        ):
            raise ValueError("the paper's law has no alpha_sign, full_acceleration or saved: leave them out")
        self._settings, self._variants = settings, frozenset(settings.variants)
        self._plant, self._limits, names = plant, limits_of(plant), plant.control_names
        self._variances = np.array([settings.Pu[name] for name in names])
        self._row = names.index("Cm_damp_yaw")
        self._columns = [names.index(name) for name in ("k_right", "k_left", "alpha")]
        self._k_hyst = round(settings.coupling.k_hyst_s / dt_s)
        m, N = len(names), settings.horizon_steps
        self._output, tau = plant.output_names.index(outputs[0]), 0
        self._dynamics = None
        if settings.dynamics is not None:
            d = settings.dynamics
            tau = round(d.tau_s / dt_s)
            positional = "positional" in self._variants
            numbers = np.array(
                [names.index(d.control), self._output, d.K_p, d.K_FF, tau, positional, np.nan], dtype=float
            )
            self._dynamics = Dynamics(alpha_dynamics, numbers, True)
        # eq:sigp: W^0, then W^i = (1 - W0) / 2m; eq:zpred prints W^i for i = 0, too.
        self._W = np.full(2 * m + 1, (1.0 - settings.W0) / (2 * m))
        printed = self._W.copy()
        self._W[0] = settings.W0
        self._W_of_mean = printed if "printed_weights" in self._variants else self._W
        self.preview_steps = max(N + tau, self._k_hyst + 1)
        self._roll_out = RollOut(
            plant.model, len(plant.output_names), range(1, N + 1), [self._output], self._limits, (2 * m + 1, m),
            self._dynamics,
        )  # fmt: skip
        self.telemetry_names: tuple[str, ...] = (f"predicted_{outputs[0]}", "repaired_covariance")
        self.reset()

    def reset(self) -> None:
        """Start again from the plant's initial control."""
        self.resume(self._plant.initial_control())

    def resume(self, control: Array) -> None:
        """Start from this control (m,) with Pu as at k = 0."""
        self._control = np.clip(control, *self._limits[:2])
        self._Pu: Array | None = None
        self._s14, self._turn, self._measured = -1.0, 0.0, np.nan

    def decide(self, state: Array, preview: Array) -> Decision:
        """A step of the law; the control is kept where it has no finite answer."""
        s, U, r = self._settings, self._control, preview[:, 0]
        hands = self._hand_signs(r)
        if self._Pu is None:
            self._Pu = self._coupled(*hands, self._signed(-1.0, r))
        Qu = s.Qu_ratio * self._coupled(*hands, self._next_s14(r))

        S, repaired = self._root(self._Pu)
        offsets = np.sqrt(len(U) / (1.0 - s.W0)) * S.T
        points = self._bounded(np.vstack([U, U + offsets, U - offsets]))
        Y, saved = self._propagated(points, state, preview)

        U_pred = self._W @ saved
        dU = saved - U_pred
        Pu_pred = Qu + (self._W[:, None] * dU).T @ dU
        Y_pred = float(self._W_of_mean @ Y)
        dY = Y - Y_pred
        C_y = s.P_err + float(self._W @ dY**2)
        K = (self._W * dY) @ dU / C_y
        wanted = U_pred + K * (r[s.horizon_steps] - Y_pred)
        telemetry = np.array([Y_pred, repaired])
        if not np.isfinite(wanted).all():
            self._Pu = None
            return Decision(U.copy(), telemetry, Status.KEPT_PREVIOUS)
        self._control = limited(wanted, U, self._limits)
        lifted = repaired > ROUNDING * np.trace(self._Pu)
        self._Pu = Pu_pred - C_y * np.outer(K, K)
        moved = Status.SOLVED if (self._control == wanted).all() else Status.SATURATED
        return Decision(self._control.copy(), telemetry, Status.REPAIRED if lifted else moved)

    def _root(self, Pu: Array) -> tuple[Array, float]:
        """Symmetric S with S S = Pu, and how far eigenvalues of Pu lie below the floor; printed: its real part."""
        values, vectors = np.linalg.eigh(0.5 * (Pu + Pu.T))
        floor = 0.0 if "indefinite_covariance" in self._variants else self._settings.covariance_floor
        lifted = np.maximum(values, floor)
        return (vectors * np.sqrt(lifted)) @ vectors.T, float((lifted - values).sum())

    def _bounded(self, points: Array) -> Array:
        """eq:minmax_utc and eq:movep; a rule that comes after the bounds can never act."""
        U, (low, high, _) = self._control, self._limits
        if "moved_after_bounds" in self._variants:
            points = np.clip(points, low, high)
        beyond = ((low == U) & (points < low)) | ((high == U) & (points > high))
        return np.clip(np.where(beyond, 1.5 * U - 0.5 * points, points), low, high)

    def _propagated(self, points: Array, state: Array, preview: Array) -> tuple[Array, Array]:
        """Outputs (2m+1,) at the horizon, and U^i (2m+1, m) of eq:xpred."""
        at, dynamics = self._roll_out, self._dynamics
        if dynamics is not None and "measured_before" in self._variants:
            now = self._plant.outputs(state)[self._output]
            dynamics.numbers[-1], self._measured = self._measured, now
        at.points[:] = points
        at(state, self._control, preview)
        if "saved_at_horizon" in self._variants:
            _, saved = at.paths(state, preview, at.outputs.shape[1])
        else:
            saved = points if dynamics is None else at.first.copy()
        return at.outputs[:, -1].copy(), saved

    def _coupled(self, s12: float, s13: float, s14: float) -> Array:
        """Pu at k = 0, as printed, with these signs in its first row."""
        found, c = np.diag(self._variances), self._settings.coupling
        row = np.array([s12 * c.k_right, s13 * c.k_left, s14 * c.alpha])
        found[self._row, self._columns] = found[self._columns, self._row] = row
        return found

    def _hand_signs(self, r: Array) -> tuple[float, float]:
        """eq_q1 or eq_q3."""
        now, change = float(np.sign(r[0])), float(np.sign(r[1] - r[0]))
        pairs = {"yaw_rate": (now, -now), "yaw_acceleration": (change, change), "none": (0.0, 0.0)}
        return pairs[self._settings.coupling.signs]

    def _next_s14(self, r: Array) -> float:
        """eq:s14; a sign of zero keeps the value before."""
        ahead = "always_ahead" in self._variants or self._s14 <= 0.0
        k = self._k_hyst if ahead and "no_hysteresis" not in self._variants else 0
        self._s14 = -float(np.sign(abs(r[k + 1]) - abs(r[k]))) or self._s14
        return self._signed(self._s14, r)

    def _signed(self, s14: float, r: Array) -> float:
        """s14 times the sign of the turn, of that to come before the first; printed: s14 itself."""
        if "unsigned_s14" in self._variants:
            return s14
        first = r[np.flatnonzero(r)[:1]]
        if r[0] != 0.0 or self._turn == 0.0:
            self._turn = float(np.sign(first[0])) if len(first) else 1.0
        return s14 * self._turn
