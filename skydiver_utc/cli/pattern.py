# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc pattern``: a neutral posture and movement patterns, made again from the settings."""

from collections.abc import Sequence
from pathlib import Path

from skydiver_utc.cli.outputs import name_of, write
from skydiver_utc.cli.settings import load_skydiver
from skydiver_utc.plants.skydiver.pattern_design import designed_pattern
from skydiver_utc.plants.skydiver.pattern_kinds import PATTERN_KINDS
from skydiver_utc.plants.skydiver.trim import straight_fall, trimmed_posture


def neutral(scenario: str, settings: Sequence[str], out: Path | None, force: bool) -> None:
    """Write the straight fall nearest to the scenario's posture at the scenario's pitch."""
    loaded, name = load_skydiver(scenario, settings), name_of(out, "neutral", force)
    plant = loaded.plant
    trim = straight_fall(loaded, plant.posture, plant.initial.pitch_deg)
    write(trimmed_posture(loaded, trim, name), out)


def design(
    scenario: str, settings: Sequence[str], kind: str, seed: int, out: Path | None, force: bool
) -> None:
    """Write a pattern of a kind for the scenario's posture, which must fall straight."""
    loaded, wanted = load_skydiver(scenario, settings), PATTERN_KINDS[kind]
    plant, name = loaded.plant, name_of(out, wanted.name, force)
    trim = straight_fall(loaded, plant.posture, plant.initial.pitch_deg)
    write(designed_pattern(wanted, loaded, trim, seed, name), out)
