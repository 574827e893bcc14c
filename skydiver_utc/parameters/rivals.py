"""Parameters of the controllers that UTC is compared with: linear-quadratic, Gauss-Newton, path-integral."""

from typing import Annotated

from skydiver_utc.parameters.fields import Parameters, quantity

_RANGE = "for a distance of the whole range"
ControlCost = Annotated[
    float, quantity("(rad/s)^2", f"cost on the control, {_RANGE} from rest", gt=0, le=1e6)
]
ChangeCost = Annotated[float, quantity("(rad/s)^2", f"cost on its changes, {_RANGE}", gt=0, le=1e9)]
Share = Annotated[
    float, quantity("1", "standard deviation of the samples as a share of the range", ge=0, le=10)
]


class CostParameters(Parameters, frozen=True):
    """The one cost of all three: squared error of the yaw rate [(rad/s)^2] plus these (`control/horizon.py`).

    Rest is a given yaw damping, hands at zero and pattern angle zero.
    """

    rest_Cm_damp_yaw: Annotated[float, quantity("1", "yaw damping coefficient at rest", ge=0, le=50)] = 0.5
    cost_Cm_damp_yaw: ControlCost = 0.1
    cost_hands: ControlCost = 0.1
    cost_alpha: ControlCost = 0.01
    change_cost_Cm_damp_yaw: ChangeCost = 1.0
    change_cost_hands: ChangeCost = 1.0
    change_cost_alpha: ChangeCost = 1.0

    @property
    def rest(self) -> tuple[float, float, float, float]:
        """The control at rest."""
        return (self.rest_Cm_damp_yaw, 0.0, 0.0, 0.0)

    @property
    def control_costs(self) -> tuple[float, float, float, float]:
        """Costs on the controls, in their order."""
        return (self.cost_Cm_damp_yaw, self.cost_hands, self.cost_hands, self.cost_alpha)

    @property
    def change_costs(self) -> tuple[float, float, float, float]:
        """Costs on their changes, in their order."""
        change = (self.change_cost_hands, self.change_cost_hands, self.change_cost_alpha)
        return (self.change_cost_Cm_damp_yaw, *change)


class LqrParameters(CostParameters, frozen=True, tag_field="kind", tag="lqr"):
    """Linear-quadratic regulator about the straight fall, with preview."""

    horizon_steps: Annotated[int, quantity("steps", "known steps of the reference", ge=1, le=1000)] = 100

    def preview_steps(self, dt_s: float) -> int:
        """Steps of the reference beyond the present that the controller needs."""
        return self.horizon_steps


class HorizonParameters(CostParameters, frozen=True):
    """The horizon of a controller that predicts: model steps, in blocks of one control each."""

    horizon_steps: Annotated[int, quantity("steps", "model steps in the horizon", ge=1, le=500)] = 20
    blocks: Annotated[int, quantity("1", "controls in the horizon; 1: one held control", ge=1, le=100)] = 4
    step_periods: Annotated[
        int,
        quantity(
            "1",
            "control periods in one model step; of 4.2 ms more than 5 are too long for Runge-Kutta in roll",
            ge=1,
            le=20,
        ),
    ] = 4

    def __post_init__(self) -> None:
        if self.horizon_steps % self.blocks:
            raise ValueError(
                f"horizon_steps ({self.horizon_steps}) must be a multiple of blocks ({self.blocks})"
            )

    def preview_steps(self, dt_s: float) -> int:
        """Steps of the reference beyond the present that the controller needs."""
        return self.horizon_steps * self.step_periods


class GaussNewtonParameters(HorizonParameters, frozen=True, tag_field="kind", tag="gauss_newton"):
    """Nonlinear model predictive control by Gauss-Newton steps under magnitude and rate limits."""

    iterations: Annotated[int, quantity("1", "Gauss-Newton steps per decision", ge=1, le=50)] = 1


class MppiParameters(HorizonParameters, frozen=True, tag_field="kind", tag="mppi"):
    """Model predictive path-integral control; the scenario's seed seeds the samples."""

    samples: Annotated[int, quantity("1", "control sequences drawn per decision", ge=2, le=100000)] = 128
    temperature: Annotated[
        float, quantity("(rad/s)^2", "cost above the least that has the weight 1/e", gt=0, le=1e6)
    ] = 0.01
    deviation_Cm_damp_yaw: Share = 0.1
    deviation_hands: Share = 0.02
    deviation_alpha: Share = 0.03

    @property
    def deviations(self) -> tuple[float, float, float, float]:
        """Standard deviations as shares of the ranges, in the order of the controls."""
        return (
            self.deviation_Cm_damp_yaw,
            self.deviation_hands,
            self.deviation_hands,
            self.deviation_alpha,
        )
