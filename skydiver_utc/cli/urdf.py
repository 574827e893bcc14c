# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc urdf``: the body of a plant as URDF."""

from collections.abc import Sequence

import click

from skydiver_utc.cli import options
from skydiver_utc.cli.errors import CommandError
from skydiver_utc.cli.settings import load


@click.command(cls=options.Computing, short_help="Print the body of SCENARIO's plant as URDF.")
@click.argument("scenario", metavar="[SCENARIO]", default="fast_turn_unknown_dynamics")
@options.settings
def urdf(scenario: str, settings: Sequence[str]) -> None:
    """Print the body of SCENARIO's plant as URDF, the robot model that ROS displays and many other tools read.

    Its joints are those of the topic `joint_states`; without SCENARIO it is the skydiver of the paper's fast turn.
    """
    from skydiver_utc.loop.build import build_plant

    loaded = load(scenario, settings)
    description = build_plant(loaded).robot_description()
    if not description:
        raise CommandError(
            f"the plant of {loaded.name}, {loaded.plant.kind}, has no body: choose another scenario"
        )
    print(description, end="")
