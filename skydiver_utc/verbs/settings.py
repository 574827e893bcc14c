"""Overrides from the command line: ``--set NAME=VALUE``."""

import re
from collections.abc import Sequence

from skydiver_utc.parameters import ParameterError, Scenario, load_scenario
from skydiver_utc.parameters.yaml_io import parse_yaml

_NAME = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*")


def load(scenario: str, settings: Sequence[str]) -> Scenario:
    """The scenario with its overrides; of one name given twice the last counts."""
    return load_scenario(scenario, dict(map(parse_setting, settings)))


def parse_setting(setting: str) -> tuple[str, object]:
    """Name and value of ``NAME=VALUE``; the value is YAML: 50 and 50.0 are numbers, [0, 5] is a list."""
    name, equals, text = (part.strip() for part in setting.partition("="))
    if not equals or not _NAME.fullmatch(name) or "\n" in text:
        raise ParameterError(
            f"--set {setting} cannot be read: write NAME=VALUE, as in controller.horizon_steps=5"
        )
    return name, parse_yaml(f"{name}: {text}", f"--set {setting}")[name]
