# SPDX-License-Identifier: Apache-2.0
"""A controller's scenario that may differ from the recorded one and change during the run."""

from collections.abc import Mapping
from typing import Any

from skydiver_utc.parameters import Scenario, from_yaml, leaves, override

# All that decides on a command, but for the reference.
_OF_A_CONTROLLER = ("controller.", "plant.", "estimator.", "disturbances.", "seed")


class TunedScenario:
    """`scenario` is in force; `changes` are the values that are not those of the recorded scenario, by dotted name."""

    def __init__(self, scenario: Scenario, delay_steps: int) -> None:
        self.scenario = scenario
        self._start, self._delay_steps = scenario, delay_steps
        self._different: dict[str, Any] = {}  # given to the controller and not to the plant
        self._changed: dict[str, Any] = {}

    @property
    def changes(self) -> dict[str, Any]:
        """All differences, live changes included."""
        delay = {"delay_steps": self._delay_steps} if self._delay_steps else {}
        return {**self._different, **self._changed, **delay}

    def compare(self, recorded: str) -> bool:
        """Compare with the recorded scenario, which is the plant's; True where it differs. Raises `ParameterError`."""
        plants = {leaf.name: leaf.value for leaf in leaves(from_yaml(recorded))}
        self._different = {
            leaf.name: plain(leaf.value)
            for leaf in leaves(self._start)
            if leaf.name.startswith(_OF_A_CONTROLLER) and leaf.value != plants.get(leaf.name)
        }
        return bool(self._different)

    def news(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """Those of the values that are not in force."""
        known = {leaf.name: plain(leaf.value) for leaf in leaves(self.scenario)}
        return {name: plain(value) for name, value in given.items() if plain(value) != known.get(name)}

    def change(self, values: Mapping[str, Any]) -> None:
        """Put these values in force. Raises `ParameterError`."""
        self.scenario = override(self.scenario, values)
        self._changed |= values


def plain(value: Any) -> Any:
    """The value as YAML would have it."""
    return value if isinstance(value, str) or not hasattr(value, "__len__") else list(value)
