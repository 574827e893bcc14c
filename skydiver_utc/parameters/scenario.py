"""One scenario: everything a flight needs."""

import math
from typing import Annotated

from skydiver_utc.parameters.body import Pattern, Posture, Subject
from skydiver_utc.parameters.controller import Controller, OpenLoopParameters, UtcParameters
from skydiver_utc.parameters.fields import Parameters, quantity, text
from skydiver_utc.parameters.plant import CONTROLS, Air, InitialCondition, PlantParameters
from skydiver_utc.parameters.reference import PostureReference, Reference, RotationReference

# Fewer steps would not show a rotation's rise and fall.
_SHORTEST_ROTATION = 10


class Scenario(Parameters, frozen=True, kw_only=True):
    """A flight, resolved: no names of other files are left in it."""

    name: str
    title: str
    description: str = ""
    duration_s: Annotated[float, quantity("s", "simulated time of the flight", gt=0, le=36000)]
    dt_s: Annotated[float, quantity("s", "control and integration step", ge=1e-4, le=0.05)]
    epoch_s: Annotated[int, quantity("s", "simulated time of step 0, Unix time", gt=0, le=4102444800)]
    seed: Annotated[int, quantity("1", "seed of every random draw; mppi alone draws", ge=0, le=2**32 - 1)] = 0
    belly_to_earth: Annotated[bool, text("whether a dorsal axis below the horizon counts as rolled over")] = (
        True
    )
    air: Air
    plant: PlantParameters
    initial: InitialCondition
    reference: Reference
    controller: Controller
    subject: Subject
    posture: Posture
    pattern: Pattern

    def __post_init__(self) -> None:
        if abs(self.dt_s * 1e9 - self.dt_ns) > 1e-3:
            raise ValueError(f"dt_s must be a whole number of nanoseconds, it is {self.dt_s}")
        if self.duration_s < self.dt_s:
            raise ValueError(f"duration_s ({self.duration_s}) must be at least one dt_s ({self.dt_s})")
        if isinstance(self.controller, OpenLoopParameters) != (self.reference.signal == "alpha"):
            raise ValueError(
                "the controller open_loop and a reference of kind posture need each other:"
                " change controller.kind or reference.kind"
            )
        limits = self.plant.limits
        self._refuse_angles_beyond(limits.alpha)
        if isinstance(self.controller, UtcParameters):
            self._refuse_rest_beyond(self.controller)
        for name in CONTROLS:
            lower, upper = getattr(limits, name)
            if not lower <= getattr(self.initial, name) <= upper:
                raise ValueError(f"initial.{name} must lie inside its limits [{lower}, {upper}]")

    def _refuse_angles_beyond(self, alphas: tuple[float, float]) -> None:
        asked: list[tuple[str, float]] = []
        if isinstance(self.reference, PostureReference):
            asked += [(f"reference.points at {time_s:g} s", alpha) for time_s, alpha in self.reference.points]
        if isinstance(self.controller, UtcParameters) and self.controller.alpha_at_rest is not None:
            asked.append(("controller.alpha_at_rest", self.controller.alpha_at_rest))
        for name, alpha in asked:
            if not alphas[0] <= alpha <= alphas[1]:
                raise ValueError(
                    f"{name} asks for alpha = {alpha:g}, plant.limits.alpha is {list(alphas)}: change one"
                )
        if (
            isinstance(self.reference, RotationReference)
            and self.reference.duration_s < _SHORTEST_ROTATION * self.dt_s
        ):
            raise ValueError(
                f"reference.duration_s must be at least {_SHORTEST_ROTATION} steps of dt_s, it is"
                f" {self.reference.duration_s}: the reference would not be seen"
            )

    def _refuse_rest_beyond(self, controller: UtcParameters) -> None:
        for name, rest, variance in zip(CONTROLS, controller.rest, controller.P_rest, strict=True):
            limits = getattr(self.plant.limits, name)
            if variance and not limits[0] <= rest <= limits[1]:
                raise ValueError(
                    f"controller draws {name} to rest at {rest:g}, outside plant.limits.{name} {list(limits)}:"
                    " change the limits or the controller's rest"
                )

    @property
    def dt_ns(self) -> int:
        """The step in integer nanoseconds."""
        return round(self.dt_s * 1e9)

    @property
    def steps(self) -> int:
        """Number of control steps K, the smallest that covers the duration."""
        return math.ceil(round(self.duration_s * 1e9) / self.dt_ns)

    @property
    def preview_steps(self) -> int:
        """Steps of the reference beyond the present that the controller needs."""
        return self.controller.preview_steps(self.dt_s)

    def stamp_ns(self, k: int) -> int:
        """Simulated time of step k in integer nanoseconds."""
        return self.epoch_s * 1_000_000_000 + k * self.dt_ns
