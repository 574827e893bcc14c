# SPDX-License-Identifier: Apache-2.0
"""Who flies a scenario, with the numbers of its controller that were tuned on that skydiver."""

from collections.abc import Iterator
from pathlib import Path

from skydiver_utc.parameters.yaml_io import read_yaml

_ATHLETE = read_yaml(Path(__file__).parent / "athlete_tuning.yaml")


def flown_by(skydiver: str, scenario: str) -> dict[str, object]:
    """Changes by dotted name: another skydiver, and for the athlete the numbers of the controller tuned on him."""
    changes: dict[str, object] = {"plant.skydiver": skydiver}
    if skydiver == "athlete":
        changes |= dict(_dotted("controller", _ATHLETE.get(scenario, {})))
    return changes


def _dotted(prefix: str, values: dict[str, object]) -> Iterator[tuple[str, object]]:
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _dotted(f"{prefix}.{name}", value)
        else:
            yield f"{prefix}.{name}", value
