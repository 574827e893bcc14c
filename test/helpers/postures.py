# SPDX-License-Identifier: Apache-2.0
"""Recorded postures as CSV files, and the names and directions that they are compared with."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.body.posture import joint_angle_names, pattern_direction, posture_angles
from skydiver_utc.parameters import SkydiverSettings, load_scenario

NAMES = joint_angle_names()


@cache
def skydiver_with(**settings: str) -> SkydiverSettings:
    """The plant of bank_recovery with other files, as pattern="pitch"."""
    plant: SkydiverSettings = load_scenario(
        "bank_recovery", {f"plant.{name}": value for name, value in settings.items()}
    ).plant
    return plant


def neutral() -> NDArray[np.float64]:
    """The neutral posture (45,) [rad]."""
    return posture_angles(skydiver_with().posture).ravel()


def direction_of(name: str) -> NDArray[np.float64]:
    """The direction (45,) of a pattern."""
    return pattern_direction(skydiver_with(pattern=name).pattern).ravel()


def csv_of(
    path: Path, postures: Any, names: Sequence[str] = NAMES, time_s: Sequence[float] | None = None
) -> Path:
    """Postures (n, m) [rad] as a CSV file, of 100 Hz unless times are given; every digit kept."""
    times = [0.01 * k for k in range(len(postures))] if time_s is None else time_s
    rows = np.rad2deg(postures).tolist()
    lines = [",".join(["time_s", *names])]
    lines += [",".join(map(repr, [float(t), *row])) for t, row in zip(times, rows, strict=True)]
    path.write_text("\n".join(lines), encoding="utf-8")
    return path
