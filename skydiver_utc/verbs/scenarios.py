"""``skydiver-utc scenarios``."""

import json

from skydiver_utc.parameters import load_scenario, scenario_names


def scenarios(as_json: bool) -> None:
    """Print name and title of every scenario that comes with the package."""
    titles = {name: load_scenario(name).title for name in scenario_names()}
    if as_json:
        print(json.dumps(titles, indent=2, ensure_ascii=False))
        return
    width = max(map(len, titles), default=0)
    for name, title in titles.items():
        print(f"{name:{width}}  {title}")
