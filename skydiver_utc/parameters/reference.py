"""Parameters of the reference profiles."""

from itertools import pairwise
from typing import Annotated, Literal

from skydiver_utc.parameters.body import PatternAngle
from skydiver_utc.parameters.fields import Parameters, quantity, text

# What a reference may be for: a body rate that a controller tracks, or the pattern angle itself.
Signal = Literal["yaw_rate", "pitch_rate", "alpha"]

Seconds = Annotated[float, quantity("s", "simulated time", ge=0, le=36000)]
RateDegS = Annotated[float, quantity("deg/s", "yaw rate, positive in a left turn", ge=-2000, le=2000)]


class SineReference(Parameters, frozen=True, tag_field="kind", tag="sine"):
    """Yaw rate amplitude sin(2 pi frequency t), eq:yr_com."""

    amplitude_deg_s: RateDegS
    frequency_hz: Annotated[float, quantity("Hz", "frequency", gt=0, le=10)]

    @property
    def signal(self) -> Signal:
        """What the profile is for."""
        return "yaw_rate"

    @property
    def amplitude_or_level_deg_s(self) -> float:
        """Largest absolute rate of the profile."""
        return abs(self.amplitude_deg_s)


class ConstantReference(Parameters, frozen=True, tag_field="kind", tag="constant"):
    """A constant yaw rate; zero is a straight fall."""

    yaw_rate_deg_s: RateDegS = 0.0

    @property
    def signal(self) -> Signal:
        """What the profile is for."""
        return "yaw_rate"

    @property
    def amplitude_or_level_deg_s(self) -> float:
        """Largest absolute rate of the profile."""
        return abs(self.yaw_rate_deg_s)


class RotationReference(Parameters, frozen=True, tag_field="kind", tag="rotation"):
    """A rotation by an angle: rate = angle / duration (1 - cos(2 pi (t - start) / duration))."""

    angle_deg: Annotated[
        float, quantity("deg", "angle to turn through, positive to the left or head down", ge=-3600, le=3600)
    ]
    duration_s: Annotated[float, quantity("s", "how long it takes", gt=0, le=600)]
    start_s: Seconds = 0.0
    signal: Annotated[Literal["yaw_rate", "pitch_rate"], text("the body rate that the profile is for")] = (
        "yaw_rate"
    )

    @property
    def amplitude_or_level_deg_s(self) -> float:
        """Largest absolute rate of the profile."""
        return 2.0 * abs(self.angle_deg) / self.duration_s


class PostureReference(Parameters, frozen=True, tag_field="kind", tag="posture"):
    """The pattern angle over time, straight lines between points (time, alpha), for an open-loop controller."""

    points: tuple[tuple[Seconds, PatternAngle], ...]

    def __post_init__(self) -> None:
        times = [time_s for time_s, _ in self.points]
        if not times:
            raise ValueError("the reference has no points: give at least one, [time, alpha]")
        if any(after <= before for before, after in pairwise(times)):
            raise ValueError(
                f"the points must be in the order of growing time, they are at {times}: sort them"
            )

    @property
    def signal(self) -> Signal:
        """What the profile is for."""
        return "alpha"

    @property
    def amplitude_or_level_deg_s(self) -> float:
        """Zero: no rate is asked for."""
        return 0.0


Reference = SineReference | ConstantReference | RotationReference | PostureReference
