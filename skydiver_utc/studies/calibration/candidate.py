# SPDX-License-Identifier: Apache-2.0
"""A skydiver to be tried: the numbers of the search, its neutral posture and its movement pattern."""

from collections.abc import Mapping
from typing import Any

from skydiver_utc.parameters import (
    MovementPattern,
    ParameterError,
    Scenario,
    SkydiverSettings,
    load_scenario,
    override,
)
from skydiver_utc.plants.skydiver.pattern_design import designed_pattern
from skydiver_utc.plants.skydiver.pattern_kinds import PATTERN_KINDS
from skydiver_utc.plants.skydiver.trim import straight_fall, trimmed_posture
from skydiver_utc.studies.calibration.settings import Calibration
from skydiver_utc.studies.design import number_at

# Entries of a segment's drag areas.
_AREAS = ("front", "side", "axial")
# What makes a skydiver; all else is the scenario's that it flies in.
_OF_SKYDIVER = ("subject", "posture", "pattern", "damping", "hands", "limbs")
_OF_FALL = ("fall_speed_m_s", "pitch_deg")
_SPEED_DIGITS = 6

# Where the numbers of a skydiver stand, which his file holds.
_OF_A_SKYDIVER = (
    "plant.subject.", "plant.damping.", "plant.hands.", "plant.limbs.", "plant.initial.pitch_deg",
    "plant.initial.fall_speed_m_s",
)  # fmt: skip


def skydiver_of(scenario: Scenario) -> dict[str, Any]:
    """The skydiver as the plain data of a file below ``config/skydivers``, its own files written out."""
    content = scenario.plant.as_dict()
    own: dict[str, Any] = {name: content[name] for name in _OF_SKYDIVER}
    return own | {"initial": {name: content["initial"][name] for name in _OF_FALL}}


def start_of(calibration: Calibration) -> Scenario:
    """The scenario whose skydiver is calibrated; refuses numbers that it does not have, and unknown flights."""
    start = calibration.start
    for flight in calibration.flights:
        load_scenario(flight.scenario, flight.settings)
    scenario = load_scenario(start.scenario, start.settings)
    if not isinstance(scenario.plant, SkydiverSettings):
        raise ParameterError(
            f"calibration {calibration.name} starts from scenario {scenario.name}, whose plant is"
            f" {scenario.plant.kind}: choose one with a skydiver"
        )
    if calibration.pattern is None and not isinstance(scenario.plant.pattern, MovementPattern):
        raise ParameterError(
            f"calibration {calibration.name} starts with pattern {scenario.plant.pattern.name}, a path through"
            " postures: choose a movement pattern"
        )
    for name, value in numbers_of(calibration, scenario).items():
        lower, upper = calibration.numbers[name]
        if not lower <= value <= upper:
            raise ParameterError(
                f"calibration {calibration.name}: {name} starts at {value:g}, outside its bounds {lower:g} to"
                f" {upper:g}; widen them, or set another start below start.settings"
            )
    return scenario


def numbers_of(calibration: Calibration, scenario: Scenario) -> dict[str, float]:
    """The values that a scenario has of the numbers of a calibration."""
    content = scenario.as_dict()
    return {name: number_at(content, _setting(name)) for name in calibration.numbers}


def build_candidate(calibration: Calibration, start: Scenario, numbers: Mapping[str, float]) -> Scenario:
    """The start with these numbers: its posture trimmed, its pattern designed. `ParameterError` where that fails.

    Posture, pattern and speed are those of the files that it is written into, so that these fly to the last bit alike.
    """
    scenario = override(start, {_setting(name): value for name, value in numbers.items()})
    plant = scenario.plant
    suit = plant.subject.suit.replace(name=calibration.name)
    plant = plant.replace(subject=plant.subject.replace(name=calibration.name, suit=suit))
    scenario = scenario.replace(plant=plant)
    trim = straight_fall(scenario, plant.posture, plant.initial.pitch_deg)
    speed = float(f"{trim.speed:.{_SPEED_DIGITS}g}")
    trimmed: Scenario = scenario.replace(
        plant=plant.replace(
            posture=trimmed_posture(scenario, trim, calibration.name),
            initial=plant.initial.replace(fall_speed_m_s=speed),
        )
    )
    if calibration.pattern is not None:
        kind, own = PATTERN_KINDS[calibration.pattern], start.plant.pattern
        known = own if isinstance(own, MovementPattern) else None
        pattern = designed_pattern(kind, trimmed, trim, start.seed, calibration.name, known)
        trimmed = trimmed.replace(plant=trimmed.plant.replace(pattern=pattern))
    return trimmed


def _setting(name: str) -> str:
    """The setting of a number of the skydiver: a segment's drag areas have names here, and places in the scenario."""
    if not name.startswith(_OF_A_SKYDIVER):
        raise ParameterError(
            f"{name} is no number of the skydiver: write one as in plant.hands.K_N or"
            " plant.subject.suit.drag_areas_m2.shank.front"
        )
    parent, _, last = name.rpartition(".")
    return f"{parent}.{_AREAS.index(last)}" if last in _AREAS else name
