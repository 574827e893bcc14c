"""Parameters of the controllers, with every reading of the paper's equations that can be chosen."""

from typing import Annotated, Literal

from skydiver_utc.parameters.fields import Parameters, quantity, text
from skydiver_utc.parameters.rivals import GaussNewtonParameters, LqrParameters, MppiParameters

Gain = Annotated[float, quantity("s", "gain from yaw rate to pattern angle", ge=-100, le=100)]
Variance = Annotated[float, quantity("control^2", "variance of one control", ge=0, le=1e6)]
Magnitude = Annotated[float, quantity("control^2", "size of one covariance", ge=0, le=1e6)]


class PoseControllerParameters(Parameters, frozen=True, tag_field="kind", tag="pose"):
    """Proportional control of the pattern angle with feed-forward (eq:lim)."""

    K_p: Gain = 1.5
    K_FF: Gain = 0.1
    Cm_damp_yaw: Annotated[float, quantity("1", "constant yaw damping coefficient", ge=0, le=50)] = 0.5
    alpha_feed_forward_max: Annotated[
        float,
        quantity(
            "rad",
            "above a feed-forward of this size the yaw damping is lowered instead; 0: damping stays constant",
            ge=0,
            le=2,
        ),
    ] = 0.0
    Cm_damp_body: Annotated[
        float, quantity("1", "what the body itself adds to the yaw damping in a steady turn", ge=0, le=50)
    ] = 0.1

    def preview_steps(self, dt_s: float) -> int:
        """Steps of the reference beyond the present that the controller needs."""
        return 0


class OpenLoopParameters(Parameters, frozen=True, tag_field="kind", tag="open_loop"):
    """No feedback: the reference is the pattern angle."""

    Cm_damp_yaw: Annotated[float, quantity("1", "constant yaw damping coefficient", ge=0, le=50)] = 0.5

    def preview_steps(self, dt_s: float) -> int:
        """Steps of the reference beyond the present that the controller needs."""
        return 0


class UtcParameters(Parameters, frozen=True, kw_only=True, tag_field="kind", tag="utc"):
    """The Unscented Transform Controller, section 3 of the paper.

    The paper's numbers stand in config/controllers/utc.yaml, which a scenario's are laid over. Fields that end in
    ``_reading`` choose between the equation as printed and the reading that works.
    """

    horizon_steps: Annotated[int, quantity("steps", "prediction horizon N = t_pred / dt", ge=1, le=500)]
    W0: Annotated[float, quantity("1", "weight of the central sigma point", gt=-10, lt=1)]
    P_err: Annotated[float, quantity("(rad/s)^2", "covariance of the tracking error", gt=0, le=1e3)]
    P_err_roll_rate: Annotated[
        float,
        quantity(
            "(rad/s)^2",
            "the same for a roll rate of zero as a further output; 0: not an output",
            ge=0,
            le=1e3,
        ),
    ] = 0.0
    P_err_fall_rate: Annotated[
        float,
        quantity(
            "(m/s)^2",
            "the same for the initial fall rate as a further output; 0: not an output",
            ge=0,
            le=1e4,
        ),
    ] = 0.0
    variance_Cm_damp_yaw: Variance
    variance_k_right: Variance
    variance_k_left: Variance
    variance_alpha: Variance
    covariance_12: Magnitude
    covariance_13: Magnitude
    covariance_14: Magnitude
    Qu_ratio: Annotated[float, quantity("1", "Qu as a share of Pu at k = 0", ge=0, le=100)]
    coupling: Annotated[
        Literal["yaw_rate", "yaw_acceleration", "none"],
        text("sign of s12, s13: eq_q1 (yaw_rate), eq_q3 (yaw_acceleration) or no coupling"),
    ] = "yaw_rate"
    k_hyst_s: Annotated[float, quantity("s", "look-ahead of eq:s14", ge=0, le=10)]
    alpha_dynamics: Annotated[
        Literal["unknown", "incremental", "positional"],
        text("dynamics of alpha inside the horizon: none, eq:m1utc, or the block diagram's law"),
    ] = "unknown"
    K_p: Gain
    K_FF: Gain
    tau_s: Annotated[float, quantity("s", "look-ahead of the feed-forward", ge=0, le=10)]
    alpha_at_rest: (
        Annotated[
            float,
            quantity(
                "rad", "pattern angle to hold once the reference has ended; null: UTC goes on", ge=-2, le=2
            ),
        ]
        | None
    ) = None
    covariance_floor: Annotated[
        float, quantity("control^2", "smallest eigenvalue kept by the repair", ge=0, le=1)
    ]
    covariance_reading: Annotated[
        Literal["repaired", "printed"],
        text("repaired: negative eigenvalues of Pu are clipped; printed: only its root is made real"),
    ] = "repaired"
    s14_recursion_reading: Annotated[
        Literal["printed", "no_hysteresis", "look_ahead"],
        text("eq:s14 as printed, without its hysteresis, or always looking ahead"),
    ] = "printed"
    s14_sign_reading: Annotated[
        Literal["signed", "printed"],
        text("signed: s14 times sign(yr_ref); printed: s14 from the change of |yr_ref| alone"),
    ] = "signed"
    saved_control_reading: Annotated[
        Literal["drawn", "first_step", "horizon"],
        text("U^i of eq:xpred: as drawn and bounded, after the first step, or at the horizon (printed)"),
    ] = "drawn"
    first_increment_reading: Annotated[
        Literal["unchanged", "measured"],
        text("yaw rate of one step ago in eq:m1utc at the start of the horizon: as now, or as measured"),
    ] = "unchanged"
    move_reading: Annotated[
        Literal["unclipped", "printed"],
        text("eq:movep on the unclipped sigma point, or after clipping as printed (never acts)"),
    ] = "unclipped"
    weights_reading: Annotated[
        Literal["normalised", "printed"],
        text("weights that sum to one, or eq:zpred as printed for i = 0 too"),
    ] = "normalised"

    full_coupling_acceleration: Annotated[
        float,
        quantity(
            "rad/s^2",
            "beyond the paper: the row of Cm_damp in Qu grows with the acceleration of the reference ahead, "
            "and is full at this one; 0: always full",
            ge=0,
            le=1e3,
        ),
    ] = 0.0
    aim: Annotated[
        Literal["end_point", "tangent"],
        text(
            "what the yaw rate at the horizon is moved to: the reference there, or (beyond the paper) its "
            "tangent of now, which a held control can follow"
        ),
    ] = "end_point"
    rest_Cm_damp_yaw: Annotated[
        float,
        quantity(
            "1",
            "yaw damping coefficient at rest, inside its limits, see P_rest_Cm_damp_yaw; 0: not given",
            ge=0,
            le=50,
        ),
    ] = 0.0
    P_rest_Cm_damp_yaw: Annotated[
        float,
        quantity(
            "1",
            "beyond the paper: the yaw damping coefficient is a further output with this covariance of its "
            "distance from rest; 0: not an output",
            ge=0,
            le=1e6,
        ),
    ] = 0.0
    P_rest_hands: Annotated[
        float, quantity("1", "the same for both hands, at rest at 0; 0: not outputs", ge=0, le=1e6)
    ] = 0.0
    P_rest_alpha: Annotated[
        float,
        quantity("rad^2", "the same for the pattern angle, at rest at 0; 0: not an output", ge=0, le=1e6),
    ] = 0.0
    covariance_leak: Annotated[
        float, quantity("1", "beyond the paper: share of Pu that is forgotten in each step", ge=0, lt=1)
    ] = 0.0
    square_root: Annotated[
        bool,
        text("beyond the paper: a factor S of Pu = S S' is kept and moved on, and Pu never formed for it"),
    ] = False

    iterations: Annotated[
        int,
        quantity(
            "1",
            "beyond the paper: updates in each step, each with sigma points from where it has led; more than one "
            "needs W0 of zero or more, square_root false, first_increment_reading unchanged",
            ge=1,
            le=20,
        ),
    ] = 1

    def __post_init__(self) -> None:
        if self.rest_Cm_damp_yaw and not self.P_rest_Cm_damp_yaw:
            raise ValueError(
                f"rest_Cm_damp_yaw is {self.rest_Cm_damp_yaw:g} without P_rest_Cm_damp_yaw: say how far from rest"
                " the coefficient may be, or set rest_Cm_damp_yaw to 0"
            )

    @property
    def P_rest(self) -> tuple[float, ...]:
        """Covariance of each control's distance from rest (4,), 0 where it is not an output."""
        return (self.P_rest_Cm_damp_yaw, self.P_rest_hands, self.P_rest_hands, self.P_rest_alpha)

    @property
    def rest(self) -> tuple[float, ...]:
        """Where each control is at rest (4,)."""
        return (self.rest_Cm_damp_yaw, 0.0, 0.0, 0.0)

    def tau_steps(self, dt_s: float) -> int:
        """Look-ahead of the feed-forward in steps."""
        return round(self.tau_s / dt_s)

    def k_hyst(self, dt_s: float) -> int:
        """Look-ahead of eq:s14 in steps."""
        return round(self.k_hyst_s / dt_s)

    def preview_steps(self, dt_s: float) -> int:
        """Steps of the reference beyond the present that the controller needs."""
        return max(self.horizon_steps + self.tau_steps(dt_s), self.k_hyst(dt_s) + 1)


Controller = (
    OpenLoopParameters
    | PoseControllerParameters
    | UtcParameters
    | LqrParameters
    | GaussNewtonParameters
    | MppiParameters
)
