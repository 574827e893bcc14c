# SPDX-License-Identifier: Apache-2.0
"""Health of a node, for its diagnostics."""

import resource
import time
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticStatus

Level = DiagnosticStatus  # its constants OK, WARN and ERROR


class Health(NamedTuple):
    """Health of a node: a level, one sentence, and values by name."""

    level: bytes
    sentence: str
    values: Mapping[str, object]


class Rate:
    """Increase of a number per second of wall time, from one call to the next."""

    def __init__(self, number: float = 0.0) -> None:
        self._read_at, self._number = time.monotonic(), number

    def read(self, number: float) -> str:
        """The rate since the last call; 0 where the number fell."""
        now = time.monotonic()
        rate = max(0.0, number - self._number) / max(now - self._read_at, 1e-9)
        self._read_at, self._number = now, number
        return f"{rate:.1f}"


def memory_mb() -> float:
    """Resident memory of this process [MB]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 1e6
