# SPDX-License-Identifier: Apache-2.0
"""Validated, frozen settings: the one source of every number that the package uses.

They come from YAML below ``config/`` or from the user's own files; `load_scenario` reads one scenario with every
file that it names, checks types, bounds and names, and returns immutable objects.
"""

from skydiver_utc.errors import ParameterError
from skydiver_utc.parameters.body import MovementPattern, Posture, PosturePath
from skydiver_utc.parameters.fields import Parameters, SlotSettings, quantity, text
from skydiver_utc.parameters.leaves import Leaf, leaves
from skydiver_utc.parameters.loading import from_yaml, load_scenario, override, scenario_names, to_yaml
from skydiver_utc.parameters.scenario import Scenario
from skydiver_utc.parameters.skydiver import SkydiverSettings

__all__ = [
    "Leaf",
    "MovementPattern",
    "ParameterError",
    "Parameters",
    "Posture",
    "PosturePath",
    "Scenario",
    "SkydiverSettings",
    "SlotSettings",
    "from_yaml",
    "leaves",
    "load_scenario",
    "override",
    "quantity",
    "scenario_names",
    "text",
    "to_yaml",
]
