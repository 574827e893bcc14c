# SPDX-License-Identifier: Apache-2.0
"""Health of a node: one diagnostic_msgs/DiagnosticStatus a second, with CPU and memory."""

import resource
import time
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

_RESIDENT = Path("/proc/self/statm")


class Level(Enum):
    """Severity, as in DiagnosticStatus."""

    OK = DiagnosticStatus.OK
    WARN = DiagnosticStatus.WARN
    ERROR = DiagnosticStatus.ERROR


class Health(NamedTuple):
    """Health of a node: a level, one sentence, and values by name."""

    level: Level
    sentence: str
    values: Mapping[str, object]


class ProcessUsage:
    """CPU time of this process since the last call, and its memory now."""

    def __init__(self) -> None:
        self._read_at, self._cpu_s = time.monotonic(), _cpu_s()

    def read(self) -> dict[str, object]:
        """cpu_percent since the last call, cpu_s since the start, memory_MB resident."""
        now, cpu_s = time.monotonic(), _cpu_s()
        percent = 100.0 * (cpu_s - self._cpu_s) / max(now - self._read_at, 1e-9)
        self._read_at, self._cpu_s = now, cpu_s
        return {"cpu_percent": f"{percent:.1f}", "cpu_s": f"{cpu_s:.2f}", "memory_MB": f"{memory_mb():.1f}"}


class Rate:
    """Steps per second of wall time, from one call to the next."""

    def __init__(self) -> None:
        self._read_at, self._step = time.monotonic(), 0

    def read(self, step: int) -> str:
        """The rate since the last call, in Hz."""
        now = time.monotonic()
        rate_hz = max(0, step - self._step) / max(now - self._read_at, 1e-9)
        self._read_at, self._step = now, step
        return f"{rate_hz:.1f}"


def diagnostic_message(name: str, health: Health) -> Any:
    """The message of one node, by its name with namespace; the stamp is the caller's."""
    status = DiagnosticStatus(
        level=health.level.value,
        name=name,
        message=health.sentence,
        hardware_id=name.rpartition("/")[0],
        values=[KeyValue(key=key, value=str(value)) for key, value in health.values.items()],
    )
    return DiagnosticArray(status=[status])


def memory_mb() -> float:
    """Resident memory of this process [MB]; where /proc is absent, the largest it ever was."""
    try:
        pages = int(_RESIDENT.read_text(encoding="ascii").split()[1])
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    return pages * resource.getpagesize() / 1e6


def _cpu_s() -> float:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime
