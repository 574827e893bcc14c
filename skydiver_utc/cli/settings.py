# SPDX-License-Identifier: Apache-2.0
"""Scenarios with overrides from the command line: ``--set NAME=VALUE``."""

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from skydiver_utc.cli.errors import CommandError
from skydiver_utc.errors import ParameterError

if TYPE_CHECKING:
    from skydiver_utc.parameters import Scenario

_NAME = re.compile(r"[A-Za-z_]\w*(\.\w+)*")


def load(scenario: str, settings: Sequence[str]) -> "Scenario":
    """The scenario with its overrides; of one name given twice the last counts."""
    from skydiver_utc.parameters import load_scenario

    return load_scenario(scenario, dict(map(parse_setting, settings)))


def load_skydiver(scenario: str, settings: Sequence[str]) -> "Scenario":
    """The same; a scenario with another plant is refused."""
    try:
        loaded = load(scenario, settings)
    except ParameterError:
        # Settings of a skydiver are wrong for another plant: its kind is the reason.
        _refuse_other_plants(load(scenario, ()))
        raise
    _refuse_other_plants(loaded)
    return loaded


def _refuse_other_plants(loaded: "Scenario") -> None:
    from skydiver_utc.parameters import SkydiverSettings

    if not isinstance(loaded.plant, SkydiverSettings):
        raise CommandError(
            f"this command is for the skydiver, the plant of {loaded.name} is {loaded.plant.kind}:"
            " choose another scenario"
        )


def parse_setting(setting: str) -> tuple[str, object]:
    """Name and value of ``NAME=VALUE``; the value is YAML: 50 and 50.0 are numbers, [0, 5] is a list."""
    from skydiver_utc.parameters.yaml_io import parse_yaml

    name, equals, text = (part.strip() for part in setting.partition("="))
    if not equals or not _NAME.fullmatch(name) or "\n" in text:
        raise ParameterError(
            f"--set {setting} cannot be read: write NAME=VALUE, as in controller.horizon_steps=5"
        )
    return name, parse_yaml(f"{name}: {text}", f"--set {setting}")[name]
