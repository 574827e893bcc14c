# SPDX-License-Identifier: Apache-2.0
"""The fit of a skydiver to the targets, stage by stage: trim, design, statics, each flight.

A stage is not begun where an earlier one misses all its targets by far, so that most of the time goes to skydivers that
nearly fit.
"""

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.parameters import ParameterError, Parameters, Scenario, SkydiverSettings, load_scenario
from skydiver_utc.plants.skydiver.model import build_model
from skydiver_utc.plants.skydiver.steady import falling_straight, steady_turns, yaw_acceleration
from skydiver_utc.studies.calibration.candidate import build_candidate, skydiver_of
from skydiver_utc.studies.calibration.settings import Calibration, StaticTarget
from skydiver_utc.studies.cases import measure
from skydiver_utc.studies.study import Bar

# A target that is met by this margin, in the logarithm of value / bar, costs next to nothing.
_MARGIN = 0.1
# The most that a target costs, and what each costs that is not reached.
_LARGEST_COST = 3.0
# Where all targets of a stage are missed by more than a factor of 3 no later one is begun.
_TOO_FAR = math.log(3.0)


class Evaluation(Parameters):
    """A skydiver that was tried.

    numbers by dotted name; of each target, in the order of `labels`, the value found, None where it is undefined or its
    stage was not begun, and whether the target is met; error: why there is no such skydiver
    """

    numbers: dict[str, float]
    found: tuple[float | None, ...]
    met: tuple[bool, ...]
    cost: float
    error: str = ""


class _Judged(NamedTuple):
    """A measure and how far it is on the wrong side of its bars, negative on the right one."""

    value: float | None
    miss: float


def labels(calibration: Calibration) -> list[tuple[str, str, Bar]]:
    """Stage, measure and bar of every target."""
    statics = [("statics", _label(target), target) for target in calibration.statics]
    flights = [(one.name, name, bar) for one in calibration.flights for name, bar in one.targets.items()]
    return [*statics, *flights]


def evaluate(calibration: Calibration, start: Scenario, numbers: Mapping[str, float]) -> Evaluation:
    """Try the skydiver with these numbers."""
    count, judged, error = len(labels(calibration)), list[_Judged](), ""
    try:
        candidate = build_candidate(calibration, start, numbers)
        for stage in _stages(calibration, candidate):
            judged += stage
            if min((one.miss for one in stage), default=0.0) > _TOO_FAR:
                break
    except ParameterError as refused:
        error = str(refused)
    missing = count - len(judged)
    # Without a straight fall or a pattern it is worse than with any.
    cost = sum(_cost(one.miss) for one in judged) + _LARGEST_COST * (missing + bool(error))
    return Evaluation(
        numbers=dict(numbers),
        found=(*(one.value for one in judged), *(None,) * missing),
        met=(*(one.miss <= 0.0 for one in judged), *(False,) * missing),
        cost=cost,
        error=error,
    )


def _stages(calibration: Calibration, candidate: Scenario) -> Iterator[list[_Judged]]:
    """The measures of one stage after the other."""
    yield [_judged(_static(target, candidate), target, 1.0) for target in calibration.statics]
    skydiver = skydiver_of(candidate)
    measured: dict[str, dict[str, float | None]] = {}
    flown: dict[str, dict[str, float | None]] = {}
    for flight in calibration.flights:
        # Two targets for one measure are two flights, which are flown once.
        same = repr((flight.scenario, flight.settings))
        if same not in flown:
            scenario = load_scenario(flight.scenario, {"plant.skydiver": skydiver, **flight.settings})
            flown[same] = measure(simulate(scenario)).as_dict()
        found = measured[flight.name] = flown[same]
        yield [
            _judged(found[name], bar, measured[bar.times][name] if bar.times else 1.0)
            for name, bar in flight.targets.items()
        ]


def _static(target: StaticTarget, candidate: Scenario) -> float | None:
    plant: SkydiverSettings = candidate.plant
    initial = plant.initial
    if target.measure == "fall_speed_m_s":
        return initial.fall_speed_m_s
    model = build_model(plant, candidate.dt_s)
    fall = falling_straight(initial.fall_speed_m_s, math.radians(initial.pitch_deg))
    alpha = plant.limits.alpha[1] if target.alpha is None else target.alpha
    if target.measure == "yaw_acceleration_rad_s2":
        return yaw_acceleration(model, fall, alpha)
    (turn,) = steady_turns(model, fall, np.array([alpha]), target.Cm_damp_yaw)
    return None if turn is None else math.degrees(turn.yaw_rate)


def _judged(value: float | None, bar: Bar, factor: float | None) -> _Judged:
    """`factor` is what the bars are multiplied with; None: undefined."""
    if value is None or factor is None:
        return _Judged(value, math.inf)
    sides = ((bar.at_most, 1.0), (bar.at_least, -1.0))
    return _Judged(value, max(side * _distance(value, wanted * factor) for wanted, side in sides if wanted))


def _distance(value: float, bar: float) -> float:
    """Distance of a value above a bar: the logarithm of value / bar; the largest cost where the signs differ."""
    if value * bar > 0.0:
        return math.copysign(1.0, bar) * math.log(value / bar)
    return math.copysign(_LARGEST_COST, value - bar) if value != bar else 0.0


def _cost(miss: float) -> float:
    """Softly from 0 for a target that is met well to the largest cost."""
    reached = miss / _MARGIN
    return min(_LARGEST_COST, _MARGIN * math.log1p(math.exp(reached)) if reached < 50.0 else miss)


def _label(target: StaticTarget) -> str:
    if target.measure == "fall_speed_m_s":
        return target.measure
    alpha = "" if target.alpha is None else f" at alpha {target.alpha:g}"
    damping = f", Cm {target.Cm_damp_yaw:g}" if target.measure == "steady_yaw_rate_deg_s" else ""
    return f"{target.measure}{alpha}{damping}"
