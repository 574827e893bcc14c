# SPDX-License-Identifier: Apache-2.0
"""Settings of the skydiver as a plant: who falls, how, through which air, and from where."""

from typing import Annotated, Literal

from pydantic import AfterValidator, model_validator
from typing_extensions import Self

from skydiver_utc.parameters.body import Pattern, PatternAngle, Posture, Subject, rising
from skydiver_utc.parameters.fields import Parameters, SlotSettings, quantity, text

DampingLimit = Annotated[float, quantity("1", "limit of the yaw damping coefficient", ge=0, le=50)]
Ratio = Annotated[float, quantity("1", "factor on what the other settings give", ge=0.2, le=5)]
HandLimit = Annotated[float, quantity("1", "limit of a hand coefficient", ge=-50, le=50)]


class Air(Parameters):
    """The air fallen through."""

    density_kg_m3: Annotated[float, quantity("kg/m3", "air density, constant over the run", gt=0, le=2)]


class Damping(Parameters):
    """Damping moments -Cm 1/2 rho |V| S L^2/2 omega; the yaw coefficient is a control."""

    Cm_damp_roll: Annotated[float, quantity("1", "roll damping moment coefficient", ge=0, le=50)]
    Cm_damp_pitch: Annotated[float, quantity("1", "pitch damping moment coefficient", ge=0, le=50)]
    reference_area_m2: Annotated[float, quantity("m2", "reference area S", gt=0, le=10)]
    reference_length_m: Annotated[float, quantity("m", "reference length L", gt=0, le=3)]


class Hands(Parameters):
    """Force of the hands and its moment about the long axis (eq_force2)."""

    force: Annotated[
        Literal["ventral", "dorsal"],
        text("where a hand pulls the body: ventral as printed in right-handed axes, or dorsal"),
    ] = "ventral"
    K_N: Annotated[float, quantity("N", "hand force for a unit coefficient", ge=0, le=500)]
    lx_m: Annotated[float, quantity("m", "distance of the hands from the long axis", ge=0, le=50)]


CONTROLS = ("Cm_damp_yaw", "k_right", "k_left", "alpha")


class Limits(Parameters):
    """Actuator limits (eq:minmax_utc) and slew rate of the pattern angle (eq:lim)."""

    Cm_damp_yaw: Annotated[tuple[DampingLimit, DampingLimit], AfterValidator(rising)]
    k_right: Annotated[tuple[HandLimit, HandLimit], AfterValidator(rising)]
    k_left: Annotated[tuple[HandLimit, HandLimit], AfterValidator(rising)]
    alpha: Annotated[tuple[PatternAngle, PatternAngle], AfterValidator(rising)]
    alpha_rate: Annotated[float, quantity("rad/s", "slew rate of the pattern angle", gt=0, le=100)]

    @property
    def minimum(self) -> tuple[float, ...]:
        """Lower bounds in control order."""
        return tuple(getattr(self, name)[0] for name in CONTROLS)

    @property
    def maximum(self) -> tuple[float, ...]:
        """Upper bounds in control order."""
        return tuple(getattr(self, name)[1] for name in CONTROLS)


class Limbs(Parameters):
    """The limbs' dynamics behind the commanded pattern angle, and whether their motion turns the body."""

    reaction: Annotated[bool, text("whether moving limbs turn the body (their angular momentum is kept)")]
    alpha_acceleration: Annotated[
        float, quantity("rad/s2", "largest acceleration of the pattern angle", gt=0, le=1e5)
    ]


class Ratios(Parameters):
    """Factors on numbers of the body that follow from many settings, 1 without; for a plant unlike its model."""

    mass: Ratio = 1.0
    inertia: Ratio = 1.0
    drag_area: Ratio = 1.0
    roll_damping: Ratio = 1.0
    pitch_damping: Ratio = 1.0
    yaw_damping: Ratio = 1.0
    pattern: Annotated[
        float, quantity("1", "factor on the joint angles that the pattern angle moves", ge=0.2, le=2)
    ] = 1.0


class InitialCondition(Parameters):
    """The start of a flight: attitude, speed and the control then applied."""

    altitude_m: Annotated[float, quantity("m", "height of the world origin's vertical axis", ge=0, le=40000)]
    fall_speed_m_s: Annotated[float, quantity("m/s", "downward speed", ge=0, le=150)]
    bank_deg: Annotated[float, quantity("deg", "roll about the body's x axis", ge=-180, le=180)] = 0.0
    pitch_deg: Annotated[float, quantity("deg", "rotation about the body's y axis", ge=-90, le=90)] = 0.0
    heading_deg: Annotated[float, quantity("deg", "heading of the head from east", ge=-360, le=360)] = 0.0
    roll_rate_deg_s: Annotated[float, quantity("deg/s", "body rate about x", ge=-1000, le=1000)] = 0.0
    pitch_rate_deg_s: Annotated[float, quantity("deg/s", "body rate about y", ge=-1000, le=1000)] = 0.0
    yaw_rate_deg_s: Annotated[float, quantity("deg/s", "body rate about z", ge=-1000, le=1000)] = 0.0
    Cm_damp_yaw: Annotated[float, quantity("1", "initial yaw damping coefficient", ge=0, le=50)] = 0.5
    k_right: Annotated[float, quantity("1", "initial right hand coefficient", ge=0, le=50)] = 0.0
    k_left: Annotated[float, quantity("1", "initial left hand coefficient", ge=0, le=50)] = 0.0
    alpha: Annotated[float, quantity("rad", "initial pattern angle", ge=-3.2, le=3.2)] = 0.0


class SkydiverSettings(SlotSettings):
    """A skydiver in free fall."""

    kind: Literal["skydiver"] = "skydiver"
    belly_to_earth: Annotated[bool, text("whether a dorsal axis below the horizon counts as rolled over")] = (
        True
    )
    air: Air
    damping: Damping
    hands: Hands
    limits: Limits
    limbs: Limbs
    ratios: Ratios = Ratios()
    pattern_nodes: Annotated[int, quantity("1", "nodes of the posture table over alpha", ge=9, le=1025)] = 65
    initial: InitialCondition
    subject: Subject
    posture: Posture
    pattern: Pattern

    @model_validator(mode="after")
    def _check(self) -> Self:
        for name in CONTROLS:
            lower, upper = getattr(self.limits, name)
            if not lower <= getattr(self.initial, name) <= upper:
                raise ValueError(f"initial.{name} must lie inside its limits [{lower}, {upper}]")
        return self
