# SPDX-License-Identifier: Apache-2.0
"""Settings of the Unscented Transform Controller: arguments of the class, block of a scenario, ROS parameters."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator
from typing_extensions import Self

from skydiver_utc.arrays import Array
from skydiver_utc.parameters.conversion import checked
from skydiver_utc.parameters.fields import Parameters, SlotSettings, quantity, text

# One variance for all, one by name, one each in order, or the matrix.
Number = Annotated[float, Field(strict=True)]
Covariance = Number | dict[str, Number] | tuple[Number, ...] | tuple[tuple[Number, ...], ...]
Gain = Annotated[float, quantity("control/output", "gain", ge=-100, le=100)]
Size = Annotated[float, quantity("control^2", "size of the covariance with Cm_damp_yaw", ge=0, le=1e6)]


class FurtherOutput(Parameters):
    """A further output, with a constant reference of its own."""

    reference: Annotated[float, quantity("output", "constant reference of this output")] = 0.0
    P_err: Annotated[float, quantity("output^2", "covariance of its tracking error", gt=0, le=1e6)]


class Nominal(Parameters):
    """Nominal value of a control, which it keeps where no output needs another one."""

    value: Annotated[float, quantity("control", "nominal value, inside the limits of the control")] = 0.0
    variance: Annotated[float, quantity("control^2", "variance of the distance from it", gt=0, le=1e6)]


class Coupling(Parameters):
    """The paper's schedule of the first row of Pu and Qu, for a turning skydiver: eq_q1, eq_q3, eq:s14."""

    signs: Annotated[
        Literal["yaw_rate", "yaw_acceleration", "none"],
        text(
            "signs of the hands' coupling: by the yaw rate, by the yaw acceleration, or no coupling of the hands"
        ),
    ] = "yaw_rate"
    k_right: Size
    k_left: Size
    alpha: Size
    alpha_sign: Annotated[
        Literal["reference", "damping"],
        text(
            "sign of the coupling with alpha: by the change of the reference (eq:s14), or by the damping left, for"
            " little sensitivity to tuning"
        ),
    ] = "reference"
    low_damping: Annotated[
        float,
        quantity(
            "1",
            "yaw damping coefficient at or below which s14 changes sign (alpha_sign: damping)",
            ge=0,
            le=50,
        ),
    ] = 0.06
    k_hyst_s: Annotated[
        float, quantity("s", "look-ahead of the sign of the coupling with alpha", ge=0, le=10)
    ] = 1.0
    full_acceleration: Annotated[
        float,
        quantity(
            "rad/s^2", "largest acceleration of the reference ahead at which the row is full; 0: always", ge=0
        ),
    ] = 0.0


class ProportionalDynamics(Parameters):
    """eq:m1utc: inside the horizon a control follows a proportional law with feed-forward, in increments."""

    control: Annotated[str, text("name of the control")]
    K_p: Gain = 1.5
    K_FF: Gain = 0.1
    tau_s: Annotated[float, quantity("s", "look-ahead of the feed-forward", ge=0, le=10)] = 0.0
    saved: Annotated[
        Literal["first_step", "drawn"],
        text(
            "U^i of eq:xpred: the control on the horizon's first step, which acts next, or the sigma point as drawn"
        ),
    ] = "first_step"


class UtcSettings(SlotSettings):
    """Every number of the law; names are those of the plant's controls and outputs."""

    kind: Literal["utc"] = "utc"
    horizon_steps: Annotated[
        Annotated[int, quantity("steps", "prediction horizon N = t_pred / dt", ge=1, le=500)]
        | tuple[Annotated[int, quantity("steps", "step at which outputs are tracked", ge=1, le=500)], ...],
        text("prediction horizon N = t_pred / dt [steps]; of several, rising, each is tracked"),
    ]
    W0: Annotated[float, quantity("1", "weight of the central sigma point", gt=-10, lt=1)] = 0.25
    P_err: Annotated[
        Covariance | None,
        text("covariance of the tracking error; null: (a tenth of what the initial Pu moves an output)^2"),
    ] = None
    outputs: Annotated[dict[str, FurtherOutput], text("further outputs")] = {}
    angles: Annotated[
        tuple[str, ...], text("outputs that are angles [rad]: 2 pi further they are the same")
    ] = ()
    innovation: Annotated[
        Literal["mean", "control"],
        text(
            "prediction that the reference is compared with: the mean of the sigma points' outputs, or the"
            " output of the control itself, which leaves no offset where the output is curved"
        ),
    ] = "mean"
    offset_share: Annotated[
        float,
        quantity(
            "1",
            "offset-free tracking: share of the difference between measured and predicted output that is taken up in"
            " each step; 0: none",
            ge=0,
            le=1,
        ),
    ] = 0.0
    Pu: Annotated[
        Covariance | None, text("initial covariance of the control; null: (a tenth of its range)^2")
    ] = None
    Qu: Annotated[
        Covariance | None, text("increase of Pu in each step; null: Qu_ratio times the initial Pu")
    ] = None
    Qu_ratio: Annotated[float, quantity("1", "Qu as a share of Pu at k = 0", ge=0, le=100)] = 0.1
    covariance_floor: Annotated[
        float | None, text("smallest eigenvalue of Pu after its repair; null: 1e-9 of the smallest variance")
    ] = None
    coupling: Annotated[
        Coupling | None, text("covariances of the controls that change with the reference")
    ] = None
    dynamics: Annotated[
        ProportionalDynamics | None, text("dynamics of a control inside the horizon; null: held")
    ] = None
    nominal: Annotated[dict[str, Nominal], text("nominal values of controls")] = {}
    forgetting_factor: Annotated[
        float, quantity("1", "share of Pu that is forgotten in each step", ge=0, lt=1)
    ] = 0.0
    tuned_at_dt_s: Annotated[
        Annotated[float, quantity("s", "step at which the numbers per step were tuned", gt=0, le=10)] | None,
        text(
            "step [s] at which horizon_steps, Qu, Qu_ratio and forgetting_factor were tuned; with another dt they are"
            " converted, which keeps what they do per second; null: they count per step, whatever dt"
        ),
    ] = None
    aim: Annotated[
        Literal["end_point", "tangent"],
        text("target of the outputs: the reference at the horizon, or the present tangent of the reference"),
    ] = "end_point"
    after_reference: Annotated[
        dict[str, Number],
        text("controls to hold, without feedback, once the reference has moved and is zero from now on"),
    ] = {}

    @model_validator(mode="after")
    def _check(self) -> Self:
        steps = self.steps
        if not steps or list(steps) != sorted(set(steps)):
            raise ValueError(f"horizon_steps is {steps}: several steps must be in rising order")
        return self

    @property
    def steps(self) -> tuple[int, ...]:
        """The steps at which outputs are tracked."""
        return self.horizon_steps if isinstance(self.horizon_steps, tuple) else (self.horizon_steps,)

    def at_step(self, dt_s: float) -> Self:
        """The settings that do the same per second with a step of dt_s, where `tuned_at_dt_s` tells theirs.

        The horizon keeps its length; Qu grows with the step, and what is not forgotten in a step is a power of it.
        P_err and nominal variances are no densities: they say how close is close enough. Raises ValueError where a
        converted number is out of its bounds.
        """
        if self.tuned_at_dt_s is None or self.tuned_at_dt_s == dt_s:
            return self
        steps_in_one = dt_s / self.tuned_at_dt_s
        horizon = tuple(sorted({max(1, round(step / steps_in_one)) for step in self.steps}))
        given = self.model_dump() | {
            "horizon_steps": horizon[0] if len(horizon) == 1 else horizon,
            "Qu": None if self.Qu is None else _scaled(self.Qu, steps_in_one),
            "Qu_ratio": steps_in_one * self.Qu_ratio,
            "forgetting_factor": 1.0 - (1.0 - self.forgetting_factor) ** steps_in_one,
            "tuned_at_dt_s": dt_s,
        }
        return checked(type(self), given)

    def preview_steps(self, dt_s: float) -> int:
        """Steps of reference that a decision takes beyond the present one."""
        ahead = self.at_step(dt_s).steps[-1] + (
            0 if self.dynamics is None else round(self.dynamics.tau_s / dt_s)
        )
        return ahead if self.coupling is None else max(ahead, round(self.coupling.k_hyst_s / dt_s) + 1)


def _scaled(given: Covariance, factor: float) -> Any:
    """A covariance times a factor, in the form given."""
    if isinstance(given, Mapping):
        return {name: factor * value for name, value in given.items()}
    return (factor * np.array(given)).tolist()


def matrix(name: str, given: Covariance, names: tuple[str, ...]) -> Array:
    """A covariance (n, n) of what the names stand for; it may be indefinite. Raises ValueError."""
    if isinstance(given, Mapping):
        if set(given) != set(names):
            raise ValueError(
                f"{name} names {', '.join(given)}; give a variance for each of {', '.join(names)}"
            )
        given = tuple(given[n] for n in names)
    array = np.array(given, dtype=float)
    if array.ndim < 2:
        if array.size not in (1, len(names)):
            raise ValueError(f"{name} has {array.size} variances for {len(names)}: {', '.join(names)}")
        array = np.diag(np.broadcast_to(array, len(names)))
    if array.shape != (len(names), len(names)):
        raise ValueError(f"{name} has shape {array.shape} for {len(names)}: {', '.join(names)}")
    if not np.allclose(array, array.T, rtol=1e-9, atol=1e-12 * np.abs(array).max()):
        raise ValueError(f"{name} is not symmetric; give (A + A.T) / 2")
    if (np.diag(array) < 0.0).any():
        raise ValueError(f"{name} has a negative variance on its diagonal: {np.diag(array).tolist()}")
    return array.copy()
