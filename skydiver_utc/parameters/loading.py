# SPDX-License-Identifier: Apache-2.0
"""From a scenario's name to a validated, frozen `Scenario`."""

import os
import sys
from collections.abc import Mapping
from os.path import isfile
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel

from skydiver_utc.errors import ParameterError, hint
from skydiver_utc.parameters.conversion import Unresolved, checked, convert
from skydiver_utc.parameters.registry import KINDS, refuse_other_code, search_modules_in
from skydiver_utc.parameters.scenario import Scenario, merged
from skydiver_utc.parameters.yaml_io import (
    parse_yaml,
    read_yaml,
    refuse_unfit,
    refuse_unresolved,
    values_in,
    write_yaml,
)

# Fields whose value may be the name of a file; and the folders below config/ that are not called by the plural.
_NAMED = ("skydiver", "subject", "segments", "suit", "joint_limits", "posture", "pattern")
_FOLDERS = {"segments": "segments", "joint_limits": "joint_limits", "study": "studies"}
_ENDINGS = (".yaml", ".yml")
_Settings = TypeVar("_Settings", bound=BaseModel)
_SLOTS_WITH_DEFAULTS = ("plant", "controller")
_OF_A_PLANT = ("plant", "truth")

Chain = tuple[Path, ...]  # of files, each named by the one before


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
    return _names_in(config_folder() / "scenarios")


def scenario_titles() -> dict[str, str]:
    """Title of each scenario that comes with the package, by its name; nothing but YAML is read."""
    folder = config_folder() / "scenarios"
    return {name: str(_read_extended(folder / f"{name}.yaml").get("title", "")) for name in scenario_names()}


def load_scenario(name_or_path: str, overrides: Mapping[str, object] | None = None) -> Scenario:
    """Read, resolve and check one scenario.

    `name_or_path` is a name below ``config/scenarios`` or the path of a YAML file; `overrides` maps
    dotted names ("controller.horizon_steps") to values. "plant.skydiver" counts as written in the file: what
    the scenario sets itself stays. A path in a file counts from the folder of that file, a path in an override from
    the current folder. Raises `ParameterError`.
    """
    path = named_path("scenario", name_or_path)
    search_modules_in(path.parent)
    content, changes = _read_extended(path), dict(overrides or {})
    if (skydiver := changes.pop("plant.skydiver", None)) is not None:
        plant = content.get("plant")
        if isinstance(plant, dict) and isinstance(plant.get("subject"), dict):
            raise ParameterError(f"{name_or_path} has its skydiver written out: change the fields of plant")
        content = merged(content, {"plant": {"skydiver": skydiver}})
    return _overridden(_over_defaults(_resolve_plant(content)), changes, origin=name_or_path)


def override(scenario: Scenario, overrides: Mapping[str, object]) -> Scenario:
    """The scenario with other values under these dotted names, checked again. Raises `ParameterError`."""
    return _overridden(scenario.as_dict(), overrides, origin=scenario.name)


def to_yaml(scenario: Scenario) -> str:
    """The resolved scenario as YAML that `from_yaml` reads back."""
    return write_yaml(scenario.as_dict())


def from_yaml(text: str) -> Scenario:
    """The scenario of a resolved text, which may come from anywhere: no file is read, no other code imported.

    Raises `ParameterError`.
    """
    refuse_unresolved(text, "the scenario")
    content = parse_yaml(text, "the scenario")
    for path, value in values_in(content):
        if path[-1:] == ("kind",) and isinstance(value, str) and ":" in value:
            refuse_other_code(value)
    return convert(content, "of the text")


def _read_extended(path: Path, seen: Chain = ()) -> dict[str, Any]:
    """The file's content laid over that of the file that it extends, the paths in both made absolute."""
    seen = _longer(seen, path)
    content = _with_table(read_yaml(path), path.parent)
    content |= {name: _absolute(content[name], path.parent) for name in _OF_A_PLANT if name in content}
    parent = content.pop("extends", None)
    if parent is None:
        return content
    name = str(parent) if str(parent).endswith(_ENDINGS) else f"{parent}.yaml"
    folders = (path.parent, config_folder() / "scenarios")
    parent_path = next(filter(isfile, (folder / name for folder in folders)), None)
    if parent_path is None:
        raise ParameterError(
            f"{path} extends {parent!r}, which is neither beside it nor comes with the package"
        )
    return merged(_read_extended(parent_path, seen), content)


def _longer(seen: Chain, path: Path) -> Chain:
    """The chain of files with one more; a file that is in it already is refused."""
    if path.resolve() in seen:
        raise ParameterError(
            f"{path} names itself, through {' and '.join(map(str, seen))}: take one name out"
        )
    return (*seen, path.resolve())


def _absolute(value: Any, folder: Path, field: str = "") -> Any:
    if isinstance(value, dict):
        return {key: _absolute(item, folder, key) for key, item in value.items()}
    if isinstance(value, list):
        return [_absolute(item, folder) for item in value]
    path = field in _NAMED and isinstance(value, str) and value.endswith(_ENDINGS)
    return str(folder.absolute() / value) if path else value


def _with_table(content: dict[str, Any], beside: Path = Path()) -> dict[str, Any]:
    """The content with the CSV file that its reference names read in; the path counts from the folder `beside`."""
    if "reference" not in content:
        return content
    return content | {"reference": _read_table(content["reference"], beside)}


def _read_table(block: Any, beside: Path) -> Any:
    """The block with the text of its CSV file; an `Unresolved` stands for one that cannot be read."""
    if isinstance(block, dict) and isinstance(block.get("parts"), list):
        block = {**block, "parts": [_read_table(part, beside) for part in block["parts"]]}
    if not (isinstance(block, dict) and block.get("kind", "csv") == "csv" and "file" in block):
        return block
    path = beside / str(block["file"])
    table: str | Unresolved
    try:
        table = path.read_text(encoding="utf-8-sig")
        refuse_unfit({"table": table}, str(path))
    except ParameterError as error:
        table = Unresolved(f"parameter reference.file: {error}")
    except (OSError, ValueError) as error:
        reason = f"{path} cannot be read ({error}): give a CSV file in UTF-8"
        table = Unresolved(f"parameter reference.file: {reason}")
    return {name: value for name, value in block.items() if name != "file"} | {"table": table}


def _resolve_plant(content: dict[str, Any]) -> dict[str, Any]:
    """The content with the files that a plant of this package names read in; a plant of the user's own has none."""
    plant = content.get("plant")
    if not isinstance(plant, dict) or ":" in str(plant.get("kind")):
        return content
    blocks = {name: content[name] for name in _OF_A_PLANT if isinstance(content.get(name), dict)}
    return content | {name: _resolved(block) for name, block in blocks.items()}


def _resolved(value: Any, seen: Chain = (), field: str = "") -> Any:
    """The value with the contents of the files named as subject, suit, posture, ...; `Unresolved` for a wrong one."""
    if field in _NAMED and isinstance(value, str):
        try:
            path = named_path(field, value)
            value = _absolute(read_yaml(path), path.parent)
        except ParameterError as error:
            return Unresolved(str(error))
        seen = _longer(seen, path)
    if isinstance(value, dict):
        return {key: _resolved(item, seen, key) for key, item in value.items()}
    return [_resolved(item, seen) for item in value] if isinstance(value, list) else value


def load_named(settings: type[_Settings], field: str, name_or_path: str) -> _Settings:
    """The settings in the file of a study, calibration or linear plant. Raises `ParameterError`."""
    try:
        return checked(settings, read_yaml(named_path(field, name_or_path)))
    except ParameterError as error:
        raise ParameterError(f"{error} ({field.replace('_', ' ')} {name_or_path})") from error


def named_path(field: str, name: str) -> Path:
    """The file of a scenario, subject, suit, ...: one that comes with the package, or any by its path."""
    words = field.replace("_", " ")
    if name.endswith(_ENDINGS):
        if not isfile(name):
            raise ParameterError(f"there is no {words} file {name}: check the path")
        return Path(name)
    folder = config_folder() / _FOLDERS.get(field, f"{field}s")
    if name not in (known := _names_in(folder)):
        advice = hint(name, known, f"choose one of {', '.join(known)}, or give the path of a YAML file")
        raise ParameterError(f"there is no {words} {name!r}: {advice}")
    return folder / f"{name}.yaml"


def _names_in(folder: Path) -> list[str]:
    return sorted(path.stem for path in folder.glob("[!_]*.yaml"))


def _overridden(content: dict[str, Any], overrides: Mapping[str, object], origin: str) -> Scenario:
    """The scenario of resolved content, which is changed, with other values under these dotted names."""
    resolved, errors = content, []
    for name, value in sorted(overrides.items(), key=_turn):
        try:
            _override(resolved, name, value)
        except ParameterError as error:
            errors.append(str(error))
        # Now, so that the next override can change a field of the file, or of the kind, that this one names.
        if isinstance(value, str | Mapping | list | tuple):
            resolved = _with_table(_resolve_plant(resolved))
        if name.removesuffix(".kind") in _SLOTS_WITH_DEFAULTS:
            resolved = _over_defaults(resolved)
    return convert(resolved, origin, errors)


def _turn(override: tuple[str, object]) -> int:
    """Whole blocks, then kinds, then settings of these."""
    name = override[0]
    return 1 if name.endswith(".kind") else 2 * ("." in name)


def _over_defaults(content: dict[str, Any]) -> dict[str, Any]:
    """Plant and controller laid over the file of their kind, if there is one; between them the plant's skydiver."""
    for slot in _SLOTS_WITH_DEFAULTS:
        block = content.get(slot)
        if not isinstance(block, dict):
            continue
        kind, own = block.get("kind"), dict(block)
        path = config_folder() / f"{slot}s" / f"{kind}.yaml"
        if isinstance(kind, str) and kind.isidentifier() and isfile(path):
            defaults = _resolved(read_yaml(path))
            skydiver = defaults.pop("skydiver", {})
            if isinstance(own.get("skydiver"), dict):
                skydiver = own.pop("skydiver")
            content = {**content, slot: merged(merged(defaults, skydiver), own)}
    return content


def _override(content: dict[str, Any], name: str, value: object) -> None:
    refuse_unfit({name: value}, "the override")
    place: Any = content
    part, rest = _entry(place, name, name)
    while rest:
        place = place.setdefault(part, {}) if isinstance(place, dict) else place[part]
        if not isinstance(place, dict | list):
            raise ParameterError(f"there is no parameter {name}: {part} has no fields")
        part, rest = _entry(place, rest, name)
    kinds = KINDS.get(name.partition(".")[0].removesuffix("s"), ())
    if part == "kind" and isinstance(value, str) and value in kinds and value != place.get("kind"):
        place.clear()  # as a block of another kind in a file replaces the block that it extends
    place[part] = value


def _entry(place: dict[str, Any] | list[Any], path: str, name: str) -> tuple[Any, str]:
    """The key of a block, itself with dots or not, or the index of an entry of a list; and the path after it."""
    part, _, rest = path.partition(".")
    if isinstance(place, dict):
        part = max((key for key in place if f"{path}.".startswith(f"{key}.")), key=len, default=part)
        return part, path[len(part) + 1 :]
    if not part.isdecimal() or int(part) >= len(place):
        raise ParameterError(f"there is no parameter {name}: the list has entries 0 to {len(place) - 1}")
    return int(part), rest
