# SPDX-License-Identifier: Apache-2.0
"""Names of run folders, and of the files in one beside its bag."""

import re
from datetime import datetime, timezone
from pathlib import Path

SCENARIO_FILE = "scenario.yaml"
VERSIONS_FILE = "versions.json"
METRICS_FILE = "metrics.json"
FIGURE_FILE = "tracking.png"
VALIDATION_FILE = "validation.png"
REPORT_FILE = "report.html"


def new_run_folder(bags: Path, name: str) -> Path:
    """Make ``<bags>/<YYYYMMDDTHHMMSSZ>_<name>``, with a number added where that exists already."""
    safe_name = re.sub(r"[^\w.-]+", "_", name)
    first = bags / f"{datetime.now(timezone.utc):%Y%m%dT%H%M%SZ}_{safe_name}"
    folder, number = first, 1
    bags.mkdir(parents=True, exist_ok=True)
    while True:
        try:
            folder.mkdir()
            return folder
        except FileExistsError:  # of another run in this second, perhaps
            number += 1
            folder = first.with_name(f"{first.name}_{number}")


def text_of(path: Path) -> str:
    """A text file of a run folder; empty where there is none, and for a link, which may lead anywhere."""
    try:
        return "" if path.is_symlink() else path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return ""
