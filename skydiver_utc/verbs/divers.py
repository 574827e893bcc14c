"""Who flies in a run: each skydiver with its name, which is its namespace, its scenario and its run folder."""

import os
import re
from collections import Counter
from collections.abc import Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import NamedTuple

from skydiver_utc.parameters import Scenario
from skydiver_utc.verbs.errors import VerbError
from skydiver_utc.verbs.settings import load

_NAMED = re.compile(r"([A-Za-z]\w*)=(.+)", re.DOTALL)
_DEFAULT_NAME = "skydiver"


class Diver(NamedTuple):
    """One skydiver of a run."""

    name: str
    scenario: Scenario
    folder: Path


def divers(given: Sequence[str], settings: Sequence[str], bags: Path, folder: Path | None) -> list[Diver]:
    """Those that the arguments ``[NAME=]SCENARIO`` name; the settings are for all of them.

    One skydiver has the run folder to itself, several have a folder each below it.
    """
    named = [_NAMED.fullmatch(text) for text in given]
    names = [
        match[1] if match else _DEFAULT_NAME + (f"_{number}" if number > 1 else "")
        for number, match in enumerate(named, 1)
    ]
    if twice := [name for name, count in Counter(names).items() if count > 1]:
        raise VerbError(f"two skydivers are called {twice[0]}: give each a name of its own, NAME=SCENARIO")
    scenarios = [
        load(match[2] if match else text, settings) for text, match in zip(given, named, strict=True)
    ]
    for name, scenario in zip(names, scenarios, strict=True):
        _refuse_other_steps(names[0], scenarios[0], name, scenario)
    several = len(names) > 1
    whole = folder or new_run_folder(bags, f"{len(names)}_skydivers" if several else scenarios[0].name)
    check_place(whole)
    folders = [whole / name if several else whole for name in names]
    return [Diver(*each) for each in zip(names, scenarios, folders, strict=True)]


def _refuse_other_steps(first: str, its: Scenario, name: str, scenario: Scenario) -> None:
    for field in ("dt_s", "epoch_s"):
        if getattr(scenario, field) != getattr(its, field):
            raise VerbError(
                f"{first} and {name} cannot fly under one clock, {field} is {getattr(its, field)} and"
                f" {getattr(scenario, field)}: set one for all by --set {field}=VALUE"
            )


def new_run_folder(bags: Path, name: str) -> Path:
    """``<bags>/<YYYYMMDDTHHMMSSZ>_<name>``, numbered if there is one of this second already."""
    name = re.sub(r"[^\w.-]+", "_", name)
    first = bags / f"{datetime.now(timezone.utc):%Y%m%dT%H%M%SZ}_{name}"
    folder, number = first, 1
    while folder.exists():
        number += 1
        folder = first.with_name(f"{first.name}_{number}")
    return folder


def check_place(folder: Path) -> None:
    """Refuse, before any node starts, a run folder that cannot be made."""
    if folder.exists():
        raise VerbError(f"{folder} exists already: name another run folder, or move this one away")
    folder.parent.mkdir(parents=True, exist_ok=True)
    if not os.access(folder.parent, os.W_OK):
        raise VerbError(
            f"nothing can be written into {folder.parent}: choose another place for the run folder"
        )
