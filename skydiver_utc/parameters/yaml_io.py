# SPDX-License-Identifier: Apache-2.0
"""Reading and writing YAML: scalars as in the core schema of YAML 1.2, no key twice, errors of one sentence."""

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from skydiver_utc.errors import ParameterError

_TAG = "tag:yaml.org,2002:"
_MERGE = f"{_TAG}merge"
_NUMBER = r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?"
# Tag -> the texts without quotes that have it, and their first characters. All else is text: no 1_000, no 1:30, no
# yes or no, no dates; 010 is ten.
_SCALARS: dict[str, tuple[str, list[str]]] = {
    f"{_TAG}null": (r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    f"{_TAG}bool": (r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    f"{_TAG}int": (r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+", list("-+0123456789")),
    f"{_TAG}float": (rf"{_NUMBER}|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)", list("-+.0123456789")),
    _MERGE: (r"<<", ["<"]),
}
# All of Unicode's but tab and newline, and those that turn the direction of a text: a terminal would obey them.
_CONTROL = re.compile("[\\x00-\\x08\\x0b-\\x1f\\x7f-\\x9f\\u202a-\\u202e\\u2066-\\u2069]")
# Bounds of a file with every alias written out; a resolved scenario has some thousand values, six blocks deep.
_MOST_VALUES, _DEEPEST = 200_000, 100
_LONGEST = 4_000_000  # characters of a resolved scenario, which has some ten thousand


# In C where PyYAML was built with libyaml.
_SafeLoader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class _StrictLoader(_SafeLoader):  # type: ignore[misc]
    """Refuses a key that stands twice in a block."""

    yaml_implicit_resolvers: dict[str, Any] = {}

    def flatten_mapping(self, node: Any) -> None:
        """Put the pairs of merged blocks (`<<`), of which the first counts, before the node's own, once."""
        if hasattr(node, "own_pairs"):
            return
        node.own_pairs = {}
        for key, value in node.value:
            if key.tag != _MERGE:
                name = self.construct_object(key)
                if name in node.own_pairs:
                    line = node.start_mark.line + 1
                    raise ParameterError(
                        f"the key {name!r} stands twice in the block at line {line}: keep one"
                    )
                node.own_pairs[name] = key, value
        merged: dict[Any, Any] = {}
        for block in [block for key, value in node.value if key.tag == _MERGE for block in _blocks(value)]:
            self.flatten_mapping(block)
            for key, value in block.value:
                merged.setdefault(self.construct_object(key), (key, value))
        node.value = list((merged | node.own_pairs).values())

    def construct_integer(self, node: yaml.ScalarNode) -> int:
        text = str(self.construct_scalar(node))
        return int(text, 0 if text[:2] in ("0o", "0x") else 10)


def _blocks(value: yaml.Node) -> list[yaml.Node]:
    """The blocks that `<<` names, one or a list."""
    blocks = value.value if isinstance(value, yaml.SequenceNode) else [value]
    for block in blocks:
        if not isinstance(block, yaml.MappingNode):
            raise ParameterError(
                f"<< at line {value.start_mark.line + 1} needs blocks of named values: name one"
            )
    return list(blocks)


class _Dumper(yaml.SafeDumper):
    """Puts a text that the loader, or one of YAML 1.1, would read as something else in quotes; writes no aliases."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


_StrictLoader.add_constructor(f"{_TAG}int", _StrictLoader.construct_integer)
for _tag, (_pattern, _first) in _SCALARS.items():
    for _side in (_StrictLoader, _Dumper):
        _side.add_implicit_resolver(_tag, re.compile(rf"(?:{_pattern})\Z"), _first)


# Beside its own error PyYAML lets through what its constructors meet in a value: a number of too many digits, a tag
# that does not fit, brackets within brackets.
_NO_YAML = (
    *(yaml.YAMLError, ValueError, LookupError, AttributeError, TypeError, OverflowError),
    RecursionError,
)


def number(text: str) -> float:
    """A finite number as YAML writes it; `ValueError` for 1_000, nan and all else that Python takes for one."""
    if not re.fullmatch(_NUMBER, text.strip()) or not math.isfinite(value := float(text)):
        raise ValueError(f"{text!r} is no finite number")
    return value


def read_yaml(path: Path) -> dict[str, Any]:
    """The mapping that a YAML file holds, every number in it finite."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ParameterError(f"{path} cannot be read: {error}") from error
    return parse_yaml(text, str(path))


def parse_yaml(text: str, origin: str) -> dict[str, Any]:
    """The mapping that a YAML text holds; `origin` names it in errors."""
    content = load_yaml(text, origin)
    if not isinstance(content, dict):
        raise ParameterError(f"{origin} must hold a mapping of names to values")
    return content


def load_yaml(text: str, origin: str) -> Any:
    """The values in a YAML text; what `refuse_unfit` refuses raises `ParameterError`."""
    try:
        content = yaml.load(text, Loader=_StrictLoader)
    except ParameterError as error:
        raise ParameterError(f"{origin}: {error}") from error
    except _NO_YAML as error:
        sentence = " ".join(str(error).split())
        raise ParameterError(f"{origin} is not valid YAML: {sentence}") from error
    refuse_unfit(content, origin)
    return content


def refuse_unresolved(text: str, origin: str) -> None:
    """Raise `ParameterError` for a text that is too long, or has aliases: `write_yaml` writes values out."""
    if len(text) > _LONGEST:
        raise ParameterError(f"{origin} has {len(text)} characters: the most are {_LONGEST}")
    if "*" not in text:
        return
    try:
        found = any(isinstance(event, yaml.AliasEvent) for event in yaml.parse(text, Loader=_StrictLoader))
    except _NO_YAML:
        return  # refused where it is loaded
    if found:
        raise ParameterError(f"{origin} has YAML aliases: write its values out")


def refuse_unfit(value: Any, origin: str) -> None:
    """Raise for numbers that are not finite, texts with control characters, and too much of anything."""
    wrong = []
    for count, (path, item) in enumerate(values_in(value)):
        reason = ""
        if isinstance(item, float) and not math.isfinite(item):
            reason = f"is {item}: write a finite number"
        elif any(isinstance(part, str) and _CONTROL.search(part) for part in (item, *path[-1:])):
            reason = "holds a control character: take it out"
        if reason:
            place = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in path)
            wrong.append(f"{_CONTROL.sub('?', place).removeprefix('.')} in {origin} {reason}")
        if count > _MOST_VALUES or len(path) > _DEEPEST:
            raise ParameterError(f"{origin} has too many values, or blocks within blocks: write less into it")
    if wrong:
        raise ParameterError("; ".join(wrong))


def values_in(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[tuple[Any, ...], Any]]:
    """The value and all values in it, with the names and places that lead there."""
    yield path, value
    if isinstance(value, dict):
        for key, item in value.items():
            yield from values_in(item, (*path, key))
    elif isinstance(value, list | tuple):
        for index, item in enumerate(value):
            yield from values_in(item, (*path, index))


def write_yaml(content: Any) -> str:
    """YAML text of plain data, in the order given, with short lists on one line."""
    return yaml.dump(content, Dumper=_Dumper, sort_keys=False, allow_unicode=True, default_flow_style=None)
