# SPDX-License-Identifier: Apache-2.0
"""How rows are timed: those to be compared take turns, so that what else the machine does meets them alike."""

import platform
import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

SCALES = {"us": 1e6, "ms": 1e3, "s": 1.0}
_FOR_A_PERCENTILE = 100
_LIBRARIES = ("numpy", "numba", "scipy", "casadi", "do-mpc", "osqp")


@dataclass(frozen=True)
class Subject:
    """Something to time: `once` does it and returns the seconds it took; `batch` repetitions make one turn."""

    name: str
    once: Callable[[], float]
    batch: int = 1
    unit: str = "us"


@dataclass(frozen=True)
class Row:
    """Median, 99th percentile and largest in `unit`, and the median as a multiple of the group's first row."""

    group: str
    name: str
    unit: str
    median: float
    p99: float
    largest: float
    ratio: float
    repetitions: int

    @property
    def slow_end(self) -> str:
        """The 99th percentile, or the largest where fewer than 100 repetitions have none."""
        return f"{self.p99:g}" if self.repetitions >= _FOR_A_PERCENTILE else f"{self.largest:g} (max)"


@dataclass(frozen=True)
class Group:
    """Subjects that are compared with the first of them, each timed in `rounds` turns after one that is not."""

    title: str
    subjects: Sequence[Subject]
    rounds: int

    def measure(self) -> Iterator[Row]:
        """The rows of the group."""
        for subject in self.subjects:
            subject.once()
        seconds: list[list[float]] = [[] for _ in self.subjects]
        for _ in range(self.rounds):
            for taken, subject in zip(seconds, self.subjects, strict=True):
                taken.extend(subject.once() for _ in range(subject.batch))
        first = float(np.median(seconds[0]))
        for taken, subject in zip(seconds, self.subjects, strict=True):
            scale, median = SCALES[subject.unit], float(np.median(taken))
            yield Row(
                group=self.title,
                name=subject.name,
                unit=subject.unit,
                median=_three(scale * median),
                p99=_three(scale * float(np.percentile(taken, 99))),
                largest=_three(scale * max(taken)),
                ratio=_three(median / first),
                repetitions=len(taken),
            )


def machine() -> dict[str, str]:
    """What the figures were measured on: processor, load, compiler, versions."""
    names = [line.split(":")[1].strip() for line in _lines("/proc/cpuinfo") if line.startswith("model name")]
    load = " ".join(line.split()[0] for line in _lines("/proc/loadavg"))
    values = {
        "cpu": f"{len(names)} x {names[0]}" if names else platform.processor(),
        "load": load,
        "cc": _compiler(),
        "python": platform.python_version(),
    }
    return values | {name: _version(name) for name in _LIBRARIES}


def _lines(path: str) -> list[str]:
    file = Path(path)
    return file.read_text().splitlines() if file.exists() else []


def _compiler() -> str:
    if shutil.which("cc") is None:
        return "none"
    return subprocess.run(
        ["cc", "--version"], check=True, capture_output=True, text=True
    ).stdout.splitlines()[0]


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "none"


def _three(value: float) -> float:
    """Rounded to three significant digits."""
    return float(f"{value:.3g}")
