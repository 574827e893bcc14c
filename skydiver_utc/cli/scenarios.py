# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc scenarios``."""

import json

from skydiver_utc.cli.errors import CommandError
from skydiver_utc.parameters import load_scenario, to_yaml
from skydiver_utc.parameters.loading import scenario_titles


def scenarios(show: str | None, as_json: bool) -> None:
    """Print name and title of every scenario, or all settings of one."""
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
