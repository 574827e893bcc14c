"""Parameters of the reference profiles."""

from typing import Annotated

from skydiver_utc.parameters.fields import Parameters, quantity

RateDegS = Annotated[float, quantity("deg/s", "yaw rate, positive in a left turn", ge=-2000, le=2000)]


class SineReference(Parameters, frozen=True, tag_field="kind", tag="sine"):
    """Yaw rate amplitude sin(2 pi frequency t), eq:yr_com."""

    amplitude_deg_s: RateDegS
    frequency_hz: Annotated[float, quantity("Hz", "frequency", gt=0, le=10)]

    @property
    def amplitude_or_level_deg_s(self) -> float:
        """Largest absolute yaw rate of the profile."""
        return abs(self.amplitude_deg_s)


class ConstantReference(Parameters, frozen=True, tag_field="kind", tag="constant"):
    """A constant yaw rate; zero is a straight fall."""

    yaw_rate_deg_s: RateDegS = 0.0

    @property
    def amplitude_or_level_deg_s(self) -> float:
        """Largest absolute yaw rate of the profile."""
        return abs(self.yaw_rate_deg_s)


Reference = SineReference | ConstantReference
