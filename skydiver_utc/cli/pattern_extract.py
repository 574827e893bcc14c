# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc pattern extract``: movement patterns of recorded postures."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from skydiver_utc.cli import options
from skydiver_utc.cli.errors import CommandError
from skydiver_utc.cli.outputs import name_of, write
from skydiver_utc.cli.screen import show_values
from skydiver_utc.cli.settings import load_skydiver

if TYPE_CHECKING:
    from skydiver_utc.arrays import Array
    from skydiver_utc.body.principal_components import PrincipalComponents
    from skydiver_utc.parameters import Scenario


@click.command(cls=options.Computing, short_help="Find the movement patterns of recorded postures.")
@click.argument("source", metavar="SOURCE", type=options.PATH)
@click.option(
    "--component",
    default=1,
    show_default=True,
    type=click.IntRange(1),
    help="Which one to write, by falling variance.",
)
@options.out_file
@click.option("--mean", type=options.PATH, metavar="FILE.yaml", help="Write the mean posture here.")
@options.force
@options.within
@options.settings
@options.as_json
def extract(
    source: Path,
    component: int,
    scenario: str,
    settings: Sequence[str],
    out: Path | None,
    mean: Path | None,
    force: bool,
    as_json: bool,
) -> None:
    """Find the movement patterns of recorded postures by principal component analysis.

    SOURCE is a run folder, a bag, an .mcap file, or joint angles in a file of OpenSim (.mot, .sto) or CSV
    (docs/patterns.md); angles that it lacks are those of the scenario's posture. A positive pattern angle has the
    largest of the accelerations about the mean posture positive: it turns left, lowers the head, slides left or
    falls slower.
    """
    import numpy as np

    from skydiver_utc.body.posture import joint_rows
    from skydiver_utc.body.principal_components import principal_components
    from skydiver_utc.cli.motion import whole_postures
    from skydiver_utc.parameters import MovementPattern, Posture
    from skydiver_utc.plants.skydiver.trim import DECIMALS

    loaded = load_skydiver(scenario, settings)
    name, name_of_mean = name_of(out, f"component_{component}", force), name_of(mean, "mean", force)
    if out is not None and mean is not None and out.resolve() == mean.resolve():
        raise CommandError(f"--out and --mean are both {out}: give each a file of its own")
    time_s, angles = whole_postures(source, loaded.plant.posture)
    found = principal_components(angles)
    if component > len(found.shares):
        raise CommandError(
            f"the postures in {source} move along {len(found.shares)} directions: choose --component from 1 to"
            f" {len(found.shares)}"
        )
    rows = [_component(loaded, found, i, angles) for i in range(len(found.shares))]
    about = f"{len(angles)} postures over {time_s[-1] - time_s[0]:g} s in {source.name}"
    chosen = rows[component - 1]
    pattern = MovementPattern(
        name=name,
        description=f"Principal component {component}; for a positive pattern angle: {chosen['effect']}",
        source=(
            f"Extracted by skydiver-utc pattern extract from {about}: component {component} explains"
            f" {chosen['explained_variance']:.4f} of the variance, its angle runs from"
            f" {chosen['alpha_rad'][0]:.3f} to {chosen['alpha_rad'][1]:.3f} rad about the mean posture"
        ),
        components=joint_rows(np.array(chosen["direction"]).round(DECIMALS)),
    )
    posture = Posture(
        name=name_of_mean,
        description="Mean of recorded postures",
        source=f"Mean, by skydiver-utc pattern extract, of {about}",
        joint_angles_deg=joint_rows(np.rad2deg(found.mean).round(DECIMALS)),
    )
    if mean is not None:
        write(posture, mean)
    if out is not None or not as_json:
        write(pattern, out)
    if out is not None or as_json:
        show_values({"postures": len(angles), "components": rows}, as_json, "direction")


def _component(scenario: "Scenario", found: "PrincipalComponents", i: int, angles: "Array") -> dict[str, Any]:
    """One component, its sign such that the largest of its accelerations is positive."""
    import numpy as np

    from skydiver_utc.plants.skydiver.pattern_report import EFFECTS, pattern_effect

    effect = pattern_effect(scenario, found.mean, found.directions[i])
    largest = int(np.abs(effect).argmax())
    direction = found.directions[i] * np.sign(effect[largest])
    alpha = (angles - found.mean.ravel()) @ direction.ravel()
    return {
        "component": i + 1,
        "explained_variance": float(found.shares[i]),
        "effect": EFFECTS[largest],
        "acceleration_per_rad": float(abs(effect[largest])),
        "alpha_rad": [float(alpha.min()), float(alpha.max())],
        "direction": direction.tolist(),
    }
