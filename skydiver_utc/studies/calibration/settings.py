# SPDX-License-Identifier: Apache-2.0
"""Settings of a calibration: numbers of the skydiver between bounds, targets for measures, the flights."""

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, model_validator
from typing_extensions import Self

from skydiver_utc.errors import hint
from skydiver_utc.parameters import Parameters, quantity, text
from skydiver_utc.parameters.body import PatternAngle, rising
from skydiver_utc.parameters.loading import load_named
from skydiver_utc.studies.cases import Measures
from skydiver_utc.studies.study import Bar

# Of `Measures`, those that a number can be wanted of.
FLIGHT_MEASURES = tuple(
    name for name, field in Measures.model_fields.items() if field.annotation == (float | None)
)


class RelativeBar(Bar):
    """Bars that a measure's distance is a share of."""

    @model_validator(mode="after")
    def _check_relative(self) -> Self:
        if 0.0 in (self.at_least, self.at_most):
            raise ValueError("a bar of 0 has no relative distance: write a small number instead")
        return self


class StaticTarget(RelativeBar):
    """A target for the straight fall, or for the turn at a held pattern angle."""

    measure: Literal["fall_speed_m_s", "yaw_acceleration_rad_s2", "steady_yaw_rate_deg_s"]
    alpha: Annotated[PatternAngle | None, text("pattern angle of the turn, where left out the largest")] = (
        None
    )
    Cm_damp_yaw: Annotated[float, quantity("1", "yaw damping coefficient of a steady turn", ge=0, le=50)] = (
        0.5
    )


class FlightBar(RelativeBar):
    """A target for a flight; with `times` the bars are factors on the same measure of an earlier flight."""

    times: Annotated[str, text("name of the earlier flight")] = ""


class ScenarioWithSettings(Parameters):
    """A scenario, and other values of its settings."""

    scenario: str
    settings: Annotated[dict[str, Any], text("overrides by dotted name")] = {}


class Flight(ScenarioWithSettings):
    """A scenario to be flown with the skydiver, and the targets for what is measured of it."""

    name: str
    targets: dict[str, FlightBar] = {}

    @model_validator(mode="after")
    def _check(self) -> Self:
        for measure in set(self.targets) - set(FLIGHT_MEASURES):
            advice = hint(measure, FLIGHT_MEASURES, f"choose one of {', '.join(FLIGHT_MEASURES)}")
            raise ValueError(f"a flight has no measure {measure}: {advice}")
        return self


class Calibration(Parameters):
    """A skydiver to be found.

    start: the search begins with the plant of this scenario; its posture is the one that is trimmed
    numbers: by dotted name, the smallest and the largest value; front, side and axial name a segment's drag areas
    pattern: the kind of movement pattern that is designed for each candidate, none to keep that of the start
    """

    name: str
    description: str
    start: ScenarioWithSettings
    numbers: dict[str, Annotated[tuple[float, float], AfterValidator(rising)]]
    pattern: Literal["turn"] | None = None
    statics: tuple[StaticTarget, ...] = ()
    flights: tuple[Flight, ...] = ()
    evaluations: Annotated[int, quantity("1", "largest number of skydivers that are tried", ge=1, le=100_000)]

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not self.numbers:
            raise ValueError("numbers is empty: write at least one number that may change")
        known: list[str] = []
        for flight in self.flights:
            if flight.name in known:
                raise ValueError(f"two flights are called {flight.name}: rename one")
            for bar in flight.targets.values():
                if bar.times and bar.times not in known:
                    raise ValueError(f"flight {flight.name}: there is no earlier flight {bar.times!r}")
            known.append(flight.name)
        if not self.statics and not any(flight.targets for flight in self.flights):
            raise ValueError("there is no target: write one below statics or below a flight")
        return self


def load_calibration(name_or_path: str) -> Calibration:
    """The calibration of a name below ``config/calibrations`` or of a YAML file. Raises `ParameterError`."""
    return load_named(Calibration, "calibration", name_or_path)
