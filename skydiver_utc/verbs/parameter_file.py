"""Postures and movement patterns as files that a scenario can name."""

from pathlib import Path
from typing import Any

import msgspec

from skydiver_utc.parameters.fields import Parameters
from skydiver_utc.parameters.yaml_io import write_yaml
from skydiver_utc.verbs.errors import VerbError

# Decimals of a degree, and of a component: rounding leaves less than 1e-6 of acceleration.
DECIMALS = 9


def name_of(out: Path | None, default: str, force: bool) -> str:
    """The name of what will be written into a file; a path that cannot be used is refused before any work."""
    if out is None:
        return default
    if out.suffix != ".yaml" or not out.parent.is_dir():
        raise VerbError(f"{out} must end in .yaml and lie in a folder that exists: choose another")
    if out.exists() and not force:
        raise VerbError(f"{out} exists: choose another file, or add --force to write over it")
    return out.stem


def write(parameters: Parameters, out: Path | None) -> None:
    """Write into the file, or on the screen."""
    content: dict[str, Any] = msgspec.to_builtins(parameters)
    if out is None:
        print(write_yaml(content), end="")
    else:
        out.write_text(write_yaml(content), encoding="utf-8")
