# SPDX-License-Identifier: Apache-2.0
"""Health of a node: one diagnostic_msgs/DiagnosticStatus a second, with CPU and memory."""

import resource
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

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


def diagnostic_message(name: str, health: Health) -> Any:
    """The message of one node, by its name with namespace; the stamp is the caller's."""
    status = DiagnosticStatus(
        level=health.level,
        name=name,
        message=health.sentence,
        hardware_id=name.rpartition("/")[0],
        values=[KeyValue(key=key, value=str(value)) for key, value in health.values.items()],
    )
    return DiagnosticArray(status=[status])


def memory_mb() -> float:
    """Resident memory of this process [MB]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 1e6
