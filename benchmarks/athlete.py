# SPDX-License-Identifier: Apache-2.0
"""Who flies a scenario, with the numbers of its controller that were tuned on that skydiver."""

from pathlib import Path

from skydiver_utc.parameters.yaml_io import read_yaml
from skydiver_utc.studies.flights import flat

_ATHLETE = read_yaml(Path(__file__).parent / "athlete_tuning.yaml")


def flown_by(skydiver: str, scenario: str) -> dict[str, object]:
    """Changes by dotted name: another skydiver, and for the athlete the numbers of the controller tuned on him."""
    changes: dict[str, object] = {"plant.skydiver": skydiver}
    if skydiver == "athlete":
        changes |= flat(_ATHLETE.get(scenario, {}), "controller.")
    return changes
