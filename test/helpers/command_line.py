# SPDX-License-Identifier: Apache-2.0
"""`skydiver-utc` as a process of its own, and in this one."""

import inspect
import os
import subprocess
import sys
from pathlib import Path

from child_processes import PATIENCE_S
from click.testing import CliRunner, Result

from skydiver_utc.cli.main import main
from skydiver_utc.cli.node_processes import PACKAGE_FOLDER

# Before click 8.2 stderr came mixed into stdout unless asked otherwise.
_APART = {"mix_stderr": False} if "mix_stderr" in inspect.signature(CliRunner).parameters else {}


def invoke(*arguments: object) -> Result:
    """A command in this process."""
    return CliRunner(**_APART).invoke(main, list(map(str, arguments)))


def refused(*arguments: object) -> str:
    """The sentence with which a command in this process is refused."""
    result = invoke(*arguments)
    assert (result.exit_code, result.stdout) == (2, ""), result.output
    assert result.stderr.count("Error: ") == 1
    return result.stderr.partition("Error: ")[2]


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
