# SPDX-License-Identifier: Apache-2.0
"""The runs of one command: each with its name, which is its namespace, its scenario and its run folder."""

import os
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from skydiver_utc.cli.errors import CommandError
from skydiver_utc.cli.settings import load

if TYPE_CHECKING:
    from skydiver_utc.parameters import Scenario

_NAME = re.compile(r"[A-Za-z]\w*")
_NAMED = re.compile(rf"({_NAME.pattern})=(.+)", re.DOTALL)
_DEFAULT_NAME = "skydiver"


class PlannedRun(NamedTuple):
    """One run; `module_folder` is the folder of a scenario file, where its own classes are, or None."""

    name: str
    scenario: "Scenario"
    folder: Path
    module_folder: Path | None


def planned_runs(given: Sequence[str], settings: Sequence[str], folder: Path | None) -> list[PlannedRun]:
    """The runs of the arguments ``[NAME=]SCENARIO``; the settings are for all of them.

    A single run has the run folder for itself, several have a folder each below it. Without a name they are
    skydiver, skydiver_2, ...
    """
    from skydiver_utc.parameters.run_folder import new_run_folder

    names, sources = [], []
    for number, text in enumerate(given, 1):
        match = _NAMED.fullmatch(text)
        name, equals, _ = text.partition("=")
        if equals and not match and not Path(text).exists() and not _NAME.fullmatch(name):
            raise CommandError(
                f"{name!r} is not a valid name of a run: take a letter, then letters, digits and underscores"
            )
        names.append(match[1] if match else _DEFAULT_NAME + (f"_{number}" if number > 1 else ""))
        sources.append(match[2] if match else text)
    if twice := [name for name, count in Counter(names).items() if count > 1]:
        raise CommandError(f"two runs are called {twice[0]}: give each its own name, NAME=SCENARIO")
    scenarios = [load(source, settings) for source in sources]
    several = len(names) > 1
    if folder is not None:
        if folder.exists():
            raise CommandError(f"{folder} exists already: name another run folder, or move this one away")
        folder.parent.mkdir(parents=True, exist_ok=True)
        if not os.access(folder.parent, os.W_OK):
            raise CommandError(f"{folder.parent} is not writable: choose another place for the run folder")
    whole = folder or new_run_folder(Path("bags"), f"{len(names)}_runs" if several else scenarios[0].name)
    modules = [Path(s).resolve().parent if s.endswith((".yaml", ".yml")) else None for s in sources]
    folders = [whole / name if several else whole for name in names]
    return list(map(PlannedRun, names, scenarios, folders, modules))
