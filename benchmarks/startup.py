# SPDX-License-Identifier: Apache-2.0
"""Processes from start to end: what a user waits for before anything flies."""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import skydiver_utc
from skydiver_utc.parameters.loading import config_folder

FIRST_DECISION = (
    "from skydiver_utc.parameters import load_scenario\n"
    "from skydiver_utc.loop.closed_loop import simulate\n"
    "simulate(load_scenario('fast_turn_unknown_dynamics', {'duration_s': 0.0042}))\n"
)
IMPORT = "import skydiver_utc.loop.closed_loop"
HELP = "import sys; from skydiver_utc.cli.main import main; sys.argv = ['skydiver-utc', '--help']; main()"
NOTHING = "pass"


@contextmanager
def fresh_install() -> Iterator[Path]:
    """A copy of the package and its configuration without any compiled kernel."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        package = Path(skydiver_utc.__file__).parent
        shutil.copytree(package, copy / "skydiver_utc", ignore=shutil.ignore_patterns("__pycache__"))
        shutil.copytree(config_folder(), copy / "config")
        yield copy


def process(program: str, package_parent: Path) -> Callable[[], float]:
    """Python running a program in a process of its own, from start to end [s of the processor]."""
    environment = {**os.environ, "PYTHONPATH": str(package_parent)}

    def once() -> float:
        begin = os.times()
        subprocess.run(
            [sys.executable, "-c", program],
            env=environment,
            cwd=package_parent,
            check=True,
            capture_output=True,
        )
        end = os.times()
        return end.children_user - begin.children_user + end.children_system - begin.children_system

    return once
