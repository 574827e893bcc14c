# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc pattern import``: measured postures as a scenario that flies them."""

import math
import shlex
from collections.abc import Sequence
from pathlib import Path

import click

from skydiver_utc.cli import options
from skydiver_utc.cli.errors import CommandError
from skydiver_utc.cli.outputs import name_of, write
from skydiver_utc.cli.settings import load_skydiver, parse_setting


@click.command("import", cls=options.Computing, short_help="Make a scenario of measured postures.")
@click.argument("source", metavar="FILE", type=options.PATH)
@click.option(
    "--out", required=True, type=options.PATH, metavar="FILE.yaml",
    help="Write the scenario here.",
)  # fmt: skip
@click.option(
    "--tolerance", default=0.5, show_default=True, type=options.number, metavar="DEG",
    help="How far the path may be from a posture that is left out.",
)  # fmt: skip
@options.force
@options.within
@options.settings
def import_(
    source: Path, out: Path, tolerance: float, scenario: str, settings: Sequence[str], force: bool
) -> None:
    """Make a scenario of measured postures, flown open loop in the time that they were measured in.

    FILE holds joint angles, of OpenSim (.mot, .sto) or as CSV (docs/patterns.md); a run folder or a bag will do, too.
    Angles that it lacks are those of the scenario's posture; angles a few degrees beyond the joint limits are clipped
    and named. As many postures are kept as the tolerance needs; how many, how far the path between them is from the
    others and how exact the plant's table of it is, is printed.
    """
    from skydiver_utc.body.movement import thin
    from skydiver_utc.cli import motion
    from skydiver_utc.parameters import load_scenario

    name = name_of(out, "", force)
    if tolerance <= 0.0:
        raise CommandError(f"--tolerance {tolerance:g} cannot be used: give degrees above zero, as in 0.5")
    plant = load_skydiver(scenario, settings).plant
    time_s, angles = motion.measured(source, plant)
    angles, clipped = motion.clipped(source, plant, time_s, angles)
    duration_s = float(time_s[-1]) - float(time_s[0])
    overrides = dict(map(parse_setting, settings)) | motion.timing(source, scenario, settings, duration_s)
    keyframes = thin(time_s, angles, math.radians(tolerance))
    error_deg = math.degrees(keyframes.error)
    kept = f"kept {len(keyframes.kept)} of {len(time_s)} postures, the path is within {error_deg:.2g} deg of all others"
    source_line = (
        f"{source.name} from {time_s[0]:g} to {time_s[-1]:g} s, by skydiver-utc pattern import: {kept}; {clipped};"
        f" angles that it lacks are those of posture {plant.posture.name}"
    )
    path = motion.path(name, source_line, time_s, angles, keyframes)
    overrides |= motion.flight(name, path, duration_s)
    flown, error = motion.exact_enough(
        source, path, lambda nodes: load_scenario(scenario, overrides | {"plant.pattern_nodes": nodes})
    )
    write(flown, out)
    print(f"{clipped}\n{kept}")
    print(f"between the plant's {flown.plant.pattern_nodes} nodes its table is off by {error}")
    print(f"fly it: {shlex.join(['skydiver-utc', 'simulate', str(out)])}")
