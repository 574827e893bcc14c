# SPDX-License-Identifier: Apache-2.0
"""Waiting for processes, and their children."""

import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

# The machine may stand still for seconds: a wait ends when its condition holds, this is only the far end.
PATIENCE_S = 150.0


def wait_until(condition: Callable[[], object], process: "subprocess.Popen[str] | None" = None) -> None:
    """Until a condition holds that other threads or processes bring about; a process that ends before failed."""
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        if time.monotonic() > deadline or (process is not None and process.poll() is not None):
            said = ""
            if process is not None:
                process.kill()
                said = f": {process.communicate()}"
            raise AssertionError(f"the condition did not come true{said}")
        time.sleep(0.02)


def children(pid: int) -> Iterator[tuple[int, str]]:
    """Process ids and command lines of a process's children."""
    for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
        yield int(child), Path(f"/proc/{child}/cmdline").read_text()


def wait_for_end(pids: list[int]) -> None:
    """Until none of these processes is there."""
    wait_until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in pids))
