# SPDX-License-Identifier: Apache-2.0
"""The children of a process, for tests that kill one of them."""

from collections.abc import Iterator
from pathlib import Path


def children(pid: int) -> Iterator[tuple[int, str]]:
    """Process ids and command lines of a process's children."""
    for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
        yield int(child), Path(f"/proc/{child}/cmdline").read_text()
