# SPDX-License-Identifier: Apache-2.0
"""Reading and writing YAML: numbers as in YAML 1.2, no key twice, errors of one sentence."""

import math
import re
from pathlib import Path
from typing import Any

import yaml

from skydiver_utc.parameters.errors import ParameterError

# In C where PyYAML was built with libyaml.
_SafeLoader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class _StrictLoader(_SafeLoader):  # type: ignore[misc]
    """Refuses a key that stands twice and reads 1e-4 as a number, as YAML 1.2 does."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        keys = [self.construct_object(key, deep=True) for key, _ in node.value]
        for key in keys:
            if keys.count(key) > 1:
                line = node.start_mark.line + 1
                raise ParameterError(f"the key {key!r} stands twice in the block at line {line}: keep one")
        mapping: dict[Any, Any] = super().construct_mapping(node, deep=deep)
        return mapping


class _Dumper(yaml.SafeDumper):
    """Puts a text that the loader would read as a number in quotes."""


for _side in (_StrictLoader, _Dumper):
    _side.add_implicit_resolver(
        "tag:yaml.org,2002:float",
        re.compile(r"^[-+]?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d+)$"),
        list("-+0123456789."),
    )


# Beside its own error PyYAML lets through what its constructors meet in a value: a date that there is not, a number
# of too many digits, a tag that does not fit, brackets within brackets.
_NO_YAML = (
    *(yaml.YAMLError, ValueError, LookupError, AttributeError, TypeError, OverflowError),
    RecursionError,
)


def read_yaml(path: Path) -> dict[str, Any]:
    """The mapping that a YAML file holds, every number in it finite."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ParameterError(f"{path} cannot be read: {error}") from error
    return parse_yaml(text, str(path))


def parse_yaml(text: str, origin: str) -> dict[str, Any]:
    """The mapping that a YAML text holds; `origin` names it in errors."""
    try:
        content = yaml.load(text, Loader=_StrictLoader)
    except ParameterError as error:
        raise ParameterError(f"{origin}: {error}") from error
    except _NO_YAML as error:
        sentence = " ".join(str(error).split())
        raise ParameterError(f"{origin} is not valid YAML: {sentence}") from error
    if not isinstance(content, dict):
        raise ParameterError(f"{origin} must hold a mapping of names to values")
    try:
        refuse_non_finite(content, origin)
    except RecursionError as error:
        raise ParameterError(f"{origin} has a block that holds itself: write it out") from error
    return content


def refuse_non_finite(value: Any, origin: str, path: str = "") -> None:
    """Raise if any number below `value` is NaN or infinite."""
    if isinstance(value, dict):
        for key, item in value.items():
            refuse_non_finite(item, origin, f"{path}.{key}" if path else str(key))
    elif isinstance(value, list | tuple):
        for index, item in enumerate(value):
            refuse_non_finite(item, origin, f"{path}[{index}]")
    elif isinstance(value, float) and not math.isfinite(value):
        raise ParameterError(f"{path} in {origin} is {value}: write a finite number")


def write_yaml(content: dict[str, Any]) -> str:
    """YAML text of plain data, in the order given, with short lists on one line."""
    return yaml.dump(
        content, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=100, default_flow_style=None
    )
