"""``skydiver-utc pattern``: a neutral posture and movement patterns, made again from the parameters."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from skydiver_utc.body.posture import joint_rows
from skydiver_utc.parameters import MovementPattern, Posture
from skydiver_utc.plant.pattern_design import design_pattern
from skydiver_utc.plant.pattern_kinds import DEFAULT_KIND, PATTERN_KINDS
from skydiver_utc.plant.trim import straight_fall
from skydiver_utc.verbs.parameter_file import DECIMALS, name_of, write
from skydiver_utc.verbs.settings import load


def neutral(scenario_name: str, settings: Sequence[str], out: Path | None, force: bool) -> None:
    """Write the straight fall nearest to the scenario's posture at the scenario's pitch."""
    scenario, name = load(scenario_name, settings), name_of(out, "neutral", force)
    start, subject = scenario.posture, scenario.subject
    trim = straight_fall(scenario, start, scenario.initial.pitch_deg)
    posture = Posture(
        name=name,
        description=(
            f"Belly to earth with the head low; subject {subject.name} falls straight down at {trim.speed:.2f} m/s"
        ),
        source=(
            f"Straight fall nearest to posture {start.name} at a pitch of {scenario.initial.pitch_deg:g} deg, by"
            f" skydiver-utc pattern neutral: segments {subject.segments.name}, suit {subject.suit.name},"
            f" joint limits {subject.joint_limits.name}"
        ),
        joint_angles_deg=joint_rows(np.rad2deg(trim.angles).round(DECIMALS)),
    )
    write(posture, out)


def design(
    scenario_name: str, settings: Sequence[str], kind_name: str, seed: int, out: Path | None, force: bool
) -> None:
    """Write a pattern of a kind for the scenario's posture, which must fall straight."""
    scenario, kind = load(scenario_name, settings), PATTERN_KINDS[kind_name]
    name = name_of(out, kind.name, force)
    trim = straight_fall(scenario, scenario.posture, scenario.initial.pitch_deg)
    direction = design_pattern(kind, scenario, trim, np.random.default_rng(seed))
    option = "" if kind_name == DEFAULT_KIND else f" --kind {kind_name}"
    pattern = MovementPattern(
        name=name,
        description=kind.description,
        source=(
            f"Designed by skydiver-utc pattern design{option} for posture {scenario.posture.name}, subject"
            f" {scenario.subject.name}, suit {scenario.subject.suit.name}, seed {seed}: {kind.aim}, within the"
            f" joint limits {scenario.subject.joint_limits.name}"
        ),
        components=joint_rows(direction.round(DECIMALS)),
    )
    write(pattern, out)
