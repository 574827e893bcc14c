"""From a scenario's name to a validated, frozen `Scenario`."""

import difflib
import math
import os
import re
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec

from skydiver_utc.parameters.scenario import Scenario
from skydiver_utc.parameters.yaml_io import ParameterError, read_yaml, refuse_non_finite, write_yaml

# Fields whose value may be the name of a file: field -> folder below config/.
_NAMED = {
    "subject": "subjects",
    "segments": "segments",
    "suit": "suits",
    "joint_limits": "joint_limits",
    "posture": "postures",
    "pattern": "patterns",
}
# What msgspec calls the things of a YAML file.
_PLAIN_WORDS = {
    "`array` of length": "a list of length",
    "`array`": "a list",
    "`object`": "a block of named values",
    "`null`": "nothing",
    "`float`": "a number",
    "`int`": "a whole number",
    "`str`": "a text",
    "`bool`": "true or false",
}


def config_folder() -> Path:
    """The folder with the YAML files: beside the package in a checkout, else in the share folder."""
    package = Path(__file__).resolve().parents[1]
    prefixes = [p for p in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if p]
    candidates = [package.parent / "config"]
    candidates += [Path(p) / "share" / "skydiver_utc" / "config" for p in (*prefixes, sys.prefix)]
    for candidate in candidates:
        if (candidate / "scenarios").is_dir():
            return candidate
    raise ParameterError(
        "the config folder of skydiver_utc is not installed: install the package again, not in editable mode"
    )


def scenario_names() -> list[str]:
    """Names of the scenarios that come with the package."""
    return sorted(path.stem for path in (config_folder() / "scenarios").glob("[!_]*.yaml"))


def load_scenario(name_or_path: str, overrides: Mapping[str, object] | None = None) -> Scenario:
    """Read, resolve and check one scenario.

    `name_or_path` is a name below ``config/scenarios`` or the path of a YAML file; `overrides` maps
    dotted names ("controller.horizon_steps") to values. Raises `ParameterError`.
    """
    path = _scenario_path(name_or_path)
    return _overridden(_read_extended(path, seen=()), overrides or {}, origin=name_or_path)


def override(scenario: Scenario, overrides: Mapping[str, object]) -> Scenario:
    """The scenario with other values under these dotted names, checked again. Raises `ParameterError`."""
    return _overridden(msgspec.to_builtins(scenario), overrides, origin=scenario.name)


def to_yaml(scenario: Scenario) -> str:
    """The resolved scenario as YAML that `load_scenario` reads back."""
    return write_yaml(msgspec.to_builtins(scenario))


def from_yaml(text: str) -> Scenario:
    """The scenario of such a text, checked as its file would be. Raises `ParameterError`."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "scenario.yaml"
        copy.write_text(text, encoding="utf-8")
        return load_scenario(str(copy))


def _scenario_path(name_or_path: str) -> Path:
    if name_or_path.endswith((".yaml", ".yml")):
        path = Path(name_or_path)
        if not path.is_file():
            raise ParameterError(f"there is no scenario file {name_or_path}: check the path")
        return path
    names = scenario_names()
    if name_or_path not in names:
        close = difflib.get_close_matches(name_or_path, names, 1)
        hint = f"did you mean {close[0]}" if close else f"choose one of {', '.join(names)}"
        raise ParameterError(f"there is no scenario {name_or_path!r}: {hint}")
    return config_folder() / "scenarios" / f"{name_or_path}.yaml"


def _read_extended(path: Path, seen: tuple[Path, ...]) -> dict[str, Any]:
    """The file's content laid over that of the file that it extends."""
    if path in seen:
        raise ParameterError(f"{path} extends itself: take one 'extends' out")
    content = read_yaml(path)
    parent = content.pop("extends", None)
    if parent is None:
        return content
    parent_path = path.parent / f"{parent}.yaml"
    if not parent_path.is_file():
        raise ParameterError(f"{path} extends {parent!r}, which does not exist beside it")
    return _merge(_read_extended(parent_path, (*seen, path)), content)


def _merge(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    merged = dict(base)
    for key, value in over.items():
        old = merged.get(key)
        # A block of another kind (a sine for a constant) replaces the old one whole.
        if isinstance(old, dict) and isinstance(value, dict):
            alike = value.get("kind", old.get("kind")) == old.get("kind")
            merged[key] = _merge(old, value) if alike else value
        else:
            merged[key] = value
    return merged


def _resolve_names(content: dict[str, Any]) -> dict[str, Any]:
    """Replace the name of a subject, suit, posture, ... by what its file holds, at any depth."""
    resolved: dict[str, Any] = {}
    for key, value in content.items():
        if key in _NAMED and isinstance(value, str):
            value = read_yaml(_named_path(key, value))
        if isinstance(value, list):
            value = [_resolve_names(item) if isinstance(item, dict) else item for item in value]
        resolved[key] = _resolve_names(value) if isinstance(value, dict) else value
    return resolved


def _named_path(field: str, name: str) -> Path:
    """The file of a subject, suit, posture, ...: one that comes with the package, or any by its path."""
    if name.endswith((".yaml", ".yml")):
        path = Path(name)
        if not path.is_file():
            raise ParameterError(f"there is no {field} file {name}: check the path")
        return path
    folder = config_folder() / _NAMED[field]
    path = folder / f"{name}.yaml"
    if not path.is_file():
        known = ", ".join(sorted(p.stem for p in folder.glob("*.yaml")))
        raise ParameterError(
            f"there is no {field} {name!r}: choose one of {known}, or give the path of a YAML file"
        )
    return path


def _overridden(content: dict[str, Any], overrides: Mapping[str, object], origin: str) -> Scenario:
    resolved = _resolve_names(content)
    for name, value in overrides.items():
        _override(resolved, name, value)
        # Now, so that the next one can reach into what this one named.
        resolved = _resolve_names(resolved)
    return _convert(_on_numbers_of_its_kind(resolved), origin)


def _on_numbers_of_its_kind(content: dict[str, Any]) -> dict[str, Any]:
    """The controller's block laid over the file of its kind, where there is one."""
    controller = content.get("controller")
    if not isinstance(controller, dict):
        return content
    path = config_folder() / "controllers" / f"{controller.get('kind')}.yaml"
    return _merge({"controller": read_yaml(path)}, content) if path.is_file() else content


def _override(content: dict[str, Any], name: str, value: object) -> None:
    *parents, last = name.split(".")
    place = content
    for parent in parents:
        place = place.setdefault(parent, {})
        if not isinstance(place, dict):
            raise ParameterError(f"there is no parameter {name}: {parent} has no fields")
    refuse_non_finite(value, "the override", name)
    place[last] = value


def _convert(content: dict[str, Any], origin: str) -> Scenario:
    try:
        return msgspec.convert(content, Scenario)
    except msgspec.ValidationError as error:
        raise ParameterError(f"{_sentence(str(error), content)} (scenario {origin})") from error


def _not_finite(value: object) -> bool:
    """True for a text like nan or inf, which YAML does not take for a number."""
    try:
        return isinstance(value, str) and not math.isfinite(float(value))
    except ValueError:
        return False


def _sentence(message: str, content: dict[str, Any]) -> str:
    """msgspec's message with the parameter's dotted name first, the value found, and a near name."""
    fault, _, place = message.partition(" - at `$")
    path = place.rstrip("`").lstrip(".")
    unknown = re.search(r"unknown field `(.+)`", fault)
    if unknown:
        name = f"{path}.{unknown[1]}" if path else unknown[1]
        kinds = _kinds_with(path, unknown[1])
        if kinds:
            own = (_value_at(content, path) or {}).get("kind")
            others = " and ".join(kinds)
            return f"parameter {name} is one of kind {others}, {path}.kind is {own}: change one of them"
        close = difflib.get_close_matches(unknown[1], _field_names(path), 1)
        return f"unknown parameter {name}: " + (f"did you mean {close[0]}" if close else "take it out")
    missing = re.search(r"missing required field `(.+)`", fault)
    if missing:
        return f"parameter {f'{path}.' if path else ''}{missing[1]} is missing: write it"
    if not path:
        return fault
    value = _value_at(content, path)
    choices = _choices(path)
    if choices and isinstance(value, str):
        return f"parameter {path}: there is no {value!r}, choose one of {', '.join(choices)}"
    if _not_finite(value):
        return f"parameter {path}: write a finite number, found {value!r}"
    for jargon, plain in _PLAIN_WORDS.items():
        fault = fault.replace(jargon, plain)
    found = f", found {value!r}" if isinstance(value, str | int | float | bool) else ""
    return f"parameter {path}: {fault[:1].lower()}{fault[1:]}{found}"


def _value_at(content: Any, path: str) -> Any:
    for part in re.findall(r"[^.\[\]]+", path):
        if isinstance(content, dict):
            content = content.get(part)
        elif isinstance(content, list) and part.isdigit():
            content = content[int(part)]
        else:
            return None
    return content


def _field_names(path: str) -> list[str]:
    """Names that may stand at `path`, over all kinds that the place admits."""
    return [f.name for t in _types_at(path) if isinstance(t, msgspec.inspect.StructType) for f in t.fields]


def _kinds_with(path: str, name: str) -> list[str]:
    """The kinds that have a field of a name, where `path` admits several."""
    structs = [t for t in _types_at(path) if isinstance(t, msgspec.inspect.StructType)]
    return [str(t.tag) for t in structs if t.tag_field and name in [f.name for f in t.fields]]


def _choices(path: str) -> list[str]:
    """The texts that may stand at `path`, where only certain ones may."""
    *_, last = re.findall(r"[^.\[\]]+", path)
    literals = [t for t in _types_at(path) if isinstance(t, msgspec.inspect.LiteralType)]
    kinds = [t for t in _types_at(path.rpartition(".")[0]) if isinstance(t, msgspec.inspect.StructType)]
    tags = [str(t.tag) for t in kinds if t.tag_field == last]
    return tags + [str(value) for t in literals for value in t.values]


def _types_at(path: str) -> list[Any]:
    types: list[Any] = [msgspec.inspect.type_info(Scenario)]
    for part in re.findall(r"[^.\[\]]+", path):
        structs = [t for t in types if isinstance(t, msgspec.inspect.StructType)]
        types = [_bare(f.type) for t in structs for f in t.fields if f.name == part]
        types = [o for t in types for o in (t.types if isinstance(t, msgspec.inspect.UnionType) else (t,))]
    return types


def _bare(kind: Any) -> Any:
    return kind.type if isinstance(kind, msgspec.inspect.Metadata) else kind
