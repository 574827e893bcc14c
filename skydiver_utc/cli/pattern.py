# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc pattern``: a neutral posture and movement patterns, made again from the settings."""

from collections.abc import Sequence
from pathlib import Path

import click

from skydiver_utc.cli import options
from skydiver_utc.cli.outputs import name_of, write
from skydiver_utc.cli.pattern_extract import extract
from skydiver_utc.cli.pattern_import import import_
from skydiver_utc.cli.pattern_show import show
from skydiver_utc.cli.settings import load_skydiver
from skydiver_utc.plants.skydiver.pattern_kinds import PATTERN_KINDS


@click.group(commands=[show, extract, import_])
def pattern() -> None:
    """Make and examine postures and movement patterns."""


@pattern.command(cls=options.Computing, short_help="Trim SCENARIO's posture to a straight fall.")
@options.scenario
@options.settings
@options.out_file
@options.force
def neutral(scenario: str, settings: Sequence[str], out: Path | None, force: bool) -> None:
    """The straight fall nearest to SCENARIO's posture, at its initial pitch, as a posture file."""
    from skydiver_utc.plants.skydiver.trim import straight_fall, trimmed_posture

    loaded, name = load_skydiver(scenario, settings), name_of(out, "neutral", force)
    plant = loaded.plant
    trim = straight_fall(loaded, plant.posture, plant.initial.pitch_deg)
    write(trimmed_posture(loaded, trim, name), out)


@pattern.command(cls=options.Computing, short_help="Design a movement pattern for SCENARIO's posture.")
@options.scenario
@options.settings
@click.option(
    "--kind", type=click.Choice(list(PATTERN_KINDS)), default="turn", show_default=True,
    help="Positive alpha turns left, lowers the head, slides to the left, or falls slower.",
)  # fmt: skip
@options.seed
@options.out_file
@options.force
def design(
    scenario: str, settings: Sequence[str], kind: str, seed: int, out: Path | None, force: bool
) -> None:
    """The pattern with the most of the wanted acceleration for the least of any other, as a pattern file."""
    from skydiver_utc.plants.skydiver.pattern_design import designed_pattern
    from skydiver_utc.plants.skydiver.trim import straight_fall

    loaded, wanted = load_skydiver(scenario, settings), PATTERN_KINDS[kind]
    plant, name = loaded.plant, name_of(out, wanted.name, force)
    trim = straight_fall(loaded, plant.posture, plant.initial.pitch_deg)
    write(designed_pattern(wanted, loaded, trim, seed, name), out)
