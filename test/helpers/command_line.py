# SPDX-License-Identifier: Apache-2.0
"""`skydiver-utc` as a process of its own."""

import os
import subprocess
import sys
from pathlib import Path

from skydiver_utc.cli.node_processes import PACKAGE_FOLDER

PATIENCE_S = 150.0


def start(*arguments: object, folder: Path | None = None, **environment: object) -> "subprocess.Popen[str]":
    """Start a command in a folder, with further variables of the environment."""
    return subprocess.Popen(
        [sys.executable, "-m", "skydiver_utc", *map(str, arguments)],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": PACKAGE_FOLDER, **{n: str(v) for n, v in environment.items()}},
    )


def call(*arguments: object, folder: Path | None = None, **environment: object) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of a command."""
    process = start(*arguments, folder=folder, **environment)
    stdout, stderr = process.communicate(timeout=2 * PATIENCE_S)
    return process.returncode, stdout, stderr
