# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc scenarios``: the scenarios of the package."""

import json

import click

from skydiver_utc.cli import options
from skydiver_utc.cli.errors import CommandError


@click.command(short_help="List the scenarios, or show one.")
@click.option("--show", metavar="SCENARIO", help="Print all settings of this scenario as YAML.")
@options.as_json
def scenarios(show: str | None, as_json: bool) -> None:
    """List the scenarios that come with the package, or show one with all its settings."""
    from skydiver_utc.parameters import load_scenario, to_yaml
    from skydiver_utc.parameters.loading import scenario_titles

    if show is not None:
        if as_json:
            raise CommandError("--show prints YAML: leave out --json")
        print(to_yaml(load_scenario(show)), end="")
        return
    titles = scenario_titles()
    if as_json:
        print(json.dumps(titles, indent=2, ensure_ascii=False))
        return
    width = max(map(len, titles), default=0)
    for name, title in titles.items():
        print(f"{name:{width}}  {title}")
