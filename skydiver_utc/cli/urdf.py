# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc urdf``: the body of a plant as URDF."""

from collections.abc import Sequence

from skydiver_utc.cli.errors import CommandError
from skydiver_utc.cli.settings import load
from skydiver_utc.loop.registry import build_plant


def urdf(scenario: str, settings: Sequence[str]) -> None:
    """Print the robot description of a scenario's plant."""
    loaded = load(scenario, settings)
    description = build_plant(loaded).robot_description()
    if not description:
        raise CommandError(
            f"the plant of {loaded.name}, {loaded.plant.kind}, has no body: choose another scenario"
        )
    print(description, end="")
