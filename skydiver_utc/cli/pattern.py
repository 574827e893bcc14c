# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc pattern``: a neutral posture and movement patterns, made again from the settings."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from skydiver_utc.body.posture import joint_rows
from skydiver_utc.cli.outputs import DECIMALS, name_of, write
from skydiver_utc.cli.settings import load_skydiver
from skydiver_utc.parameters import MovementPattern, Posture
from skydiver_utc.plants.skydiver.pattern_design import design_pattern
from skydiver_utc.plants.skydiver.pattern_kinds import DEFAULT_KIND, PATTERN_KINDS
from skydiver_utc.plants.skydiver.trim import straight_fall


def neutral(scenario: str, settings: Sequence[str], out: Path | None, force: bool) -> None:
    """Write the straight fall nearest to the scenario's posture at the scenario's pitch."""
    loaded, name = load_skydiver(scenario, settings), name_of(out, "neutral", force)
    plant = loaded.plant
    start, subject = plant.posture, plant.subject
    trim = straight_fall(loaded, start, plant.initial.pitch_deg)
    posture = Posture(
        name=name,
        description=(
            f"Belly to earth with the head low; subject {subject.name} falls straight down at {trim.speed:.2f} m/s"
        ),
        source=(
            f"Straight fall nearest to posture {start.name} at a pitch of {plant.initial.pitch_deg:g} deg, by"
            f" skydiver-utc pattern neutral: segments {subject.segments.name}, suit {subject.suit.name},"
            f" joint limits {subject.joint_limits.name}"
        ),
        joint_angles_deg=joint_rows(np.rad2deg(trim.angles).round(DECIMALS)),
    )
    write(posture, out)


def design(
    scenario: str, settings: Sequence[str], kind: str, seed: int, out: Path | None, force: bool
) -> None:
    """Write a pattern of a kind for the scenario's posture, which must fall straight."""
    loaded, wanted = load_skydiver(scenario, settings), PATTERN_KINDS[kind]
    plant, subject = loaded.plant, loaded.plant.subject
    name = name_of(out, wanted.name, force)
    trim = straight_fall(loaded, plant.posture, plant.initial.pitch_deg)
    direction = design_pattern(wanted, loaded, trim, np.random.default_rng(seed))
    option = "" if kind == DEFAULT_KIND else f" --kind {kind}"
    pattern = MovementPattern(
        name=name,
        description=wanted.description,
        source=(
            f"Designed by skydiver-utc pattern design{option} for posture {plant.posture.name}, subject"
            f" {subject.name}, suit {subject.suit.name}, seed {seed}: {wanted.aim}, within the joint limits"
            f" {subject.joint_limits.name}"
        ),
        components=joint_rows(direction.round(DECIMALS)),
    )
    write(pattern, out)
