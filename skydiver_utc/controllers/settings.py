# SPDX-License-Identifier: Apache-2.0
"""Settings of the controllers that UTC is compared with; tables are by the names of the plant's controls."""

from typing import Annotated, Literal

from pydantic import Field, model_validator
from typing_extensions import Self

from skydiver_utc.parameters.fields import SlotSettings, quantity, text

Number = Annotated[float, Field(strict=True)]
Cost = Annotated[float, quantity("output^2", "cost", gt=0, le=1e9)]
Share = Annotated[float, quantity("1", "standard deviation as a share of the range", ge=0, le=10)]


class OpenLoopSettings(SlotSettings):
    """No feedback: controls named by the reference follow it; the others keep their initial values."""

    kind: Literal["open_loop"] = "open_loop"


class PoseSettings(SlotSettings):
    """Proportional control of the skydiver's pattern angle with feed-forward (eq:lim)."""

    kind: Literal["pose"] = "pose"
    K_p: Annotated[
        float, quantity("s", "gain from the rate's error to the pattern angle", ge=-100, le=100)
    ] = 1.5
    K_FF: Annotated[float, quantity("s", "gain from the reference to the pattern angle", ge=-100, le=100)] = (
        0.1
    )
    Cm_damp_yaw: Annotated[float, quantity("1", "constant yaw damping coefficient", ge=0, le=50)] = 0.5
    alpha_feed_forward_max: Annotated[
        float,
        quantity("rad", "feed-forward above which the yaw damping is lowered instead; 0: never", ge=0, le=2),
    ] = 0.0
    Cm_damp_body: Annotated[
        float, quantity("1", "what the body itself adds to the yaw damping in a steady turn", ge=0, le=50)
    ] = 0.1


class CostSettings(SlotSettings):
    """The one cost of all three rivals: squared error of the outputs plus these (`controllers/horizon.py`)."""

    nominal: Annotated[
        dict[str, Number], text("value at which a control costs nothing; not named: its initial value")
    ] = {}
    cost: Annotated[
        dict[str, Cost], text("of a distance of the whole range from nominal; not named: 0.1")
    ] = {}
    change_cost: Annotated[dict[str, Cost], text("of a change of the whole range; not named: 1")] = {}


class LqrSettings(CostSettings):
    """Linear-quadratic regulator about the plant's equilibrium, with preview."""

    kind: Literal["lqr"] = "lqr"
    horizon_steps: Annotated[int, quantity("steps", "known steps of the reference", ge=1, le=1000)] = 100

    def preview_steps(self, dt_s: float) -> int:
        """Steps of reference that a decision takes beyond the present one."""
        return self.horizon_steps


class HorizonSettings(CostSettings):
    """The horizon of a controller that predicts: model steps, in blocks of one control each."""

    horizon_steps: Annotated[int, quantity("steps", "model steps in the horizon", ge=1, le=500)] = 20
    blocks: Annotated[int, quantity("1", "controls in the horizon; 1: one held control", ge=1, le=100)] = 4
    step_periods: Annotated[
        int,
        quantity(
            "1", "control periods in one model step; the skydiver's Runge-Kutta takes up to 5", ge=1, le=20
        ),
    ] = 1

    def preview_steps(self, dt_s: float) -> int:
        """Steps of reference that a decision takes beyond the present one."""
        return self.horizon_steps * self.step_periods

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.horizon_steps % self.blocks:
            raise ValueError(
                f"horizon_steps ({self.horizon_steps}) must be a multiple of blocks ({self.blocks})"
            )
        return self


class GaussNewtonSettings(HorizonSettings):
    """Nonlinear model predictive control by Gauss-Newton steps under magnitude and rate limits."""

    kind: Literal["gauss_newton"] = "gauss_newton"
    iterations: Annotated[int, quantity("1", "Gauss-Newton steps per decision", ge=1, le=50)] = 1


class MppiSettings(HorizonSettings):
    """Model predictive path-integral control; the scenario's seed seeds the samples."""

    kind: Literal["mppi"] = "mppi"
    samples: Annotated[int, quantity("1", "control sequences drawn per decision", ge=2, le=100000)] = 128
    temperature: Annotated[
        float, quantity("output^2", "cost above the least that has the weight 1/e", gt=0, le=1e6)
    ] = 0.01
    deviation: Annotated[dict[str, Share], text("standard deviation of the samples; not named: 0.1")] = {}
