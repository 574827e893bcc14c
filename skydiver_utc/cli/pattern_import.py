# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc pattern import``: measured postures as a path that can be flown."""

import math
from collections.abc import Sequence
from pathlib import Path

import click

from skydiver_utc.cli import options
from skydiver_utc.cli.errors import CommandError
from skydiver_utc.cli.outputs import name_of, write
from skydiver_utc.cli.settings import load_skydiver


@click.command("import", cls=options.Computing, short_help="Make a path of measured postures, to be flown.")
@click.argument("source", metavar="FILE", type=options.PATH)
@click.option(
    "--out", required=True, type=options.PATH, metavar="FILE.yaml",
    help="Write the path here, its first posture beside it.",
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
    """Make a path of measured postures, to be flown open loop in the time that they were measured in.

    FILE holds joint angles, of OpenSim (.mot, .sto) or as CSV (docs/patterns.md); a run folder or a bag will do, too.
    Angles that it lacks are those of the scenario's posture; angles a few degrees beyond the joint limits are clipped
    and named. As many postures are kept as the tolerance needs; how many, how far the path is from the others and
    how exact the plant's table of it is, is printed with the command that flies it.
    """
    from skydiver_utc.body.movement import thin
    from skydiver_utc.cli import motion
    from skydiver_utc.parameters import Posture

    name = name_of(out, "", force)
    start = out.with_name(f"{name}_start.yaml")
    name_of(start, "", force)
    if not 0.0 < tolerance < math.inf:
        raise CommandError(f"--tolerance {tolerance:g} cannot be used: give degrees above zero, as in 0.5")
    plant = load_skydiver(scenario, settings).plant
    time_s, angles = motion.measured(source, plant)
    angles, clipped = motion.clipped(source, plant, time_s, angles)
    duration_s = float(time_s[-1]) - float(time_s[0])
    in_time = motion.in_time(source, plant, scenario, settings, duration_s)
    keyframes = thin(time_s, angles, math.radians(tolerance))
    kept = motion.kept(keyframes, len(time_s))
    source_line = (
        f"{source.name} from {time_s[0]:g} to {time_s[-1]:g} s, by skydiver-utc pattern import: {kept}; {clipped};"
        f" angles that it lacks are those of posture {plant.posture.name}"
    )
    path = motion.path(name, source_line, time_s, angles, keyframes)
    first = Posture(
        name=start.stem,
        description="First posture of a motion",
        source=source_line,
        joint_angles_deg=path.keyframes[0].posture.joint_angles_deg,
    )

    def settings_with(nodes: int) -> list[str]:
        return [*settings, *motion.settings_of(out, start, duration_s, nodes), *in_time]

    table = motion.table(
        source, path, lambda nodes: motion.scenario_of(scenario, settings_with(nodes), path, first)
    )
    write(path, out)
    write(first, start)
    print(f"{clipped}\n{kept}\nbetween the plant's {table.nodes} nodes its table is off by {table.error}")
    print(f"{out} holds the path, {start} its first posture; to fly it:\n")
    print(motion.command(scenario, settings_with(table.nodes)))
