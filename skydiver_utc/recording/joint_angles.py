# SPDX-License-Identifier: Apache-2.0
"""Joint angles over time, from a recording or from a CSV file of measurements."""

import csv
import difflib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.parameters.nanoseconds import seconds, stamp_ns
from skydiver_utc.parameters.yaml_io import number
from skydiver_utc.recording.errors import RecordingError
from skydiver_utc.recording.namespace import namespace_of
from skydiver_utc.recording.reader import read_bag

_TOPIC = "joint_states"
_TIME = "time_s"
_SUFFIX = "_deg"
_LARGEST_DEG = 180.0


@dataclass(frozen=True, eq=False)
class JointAngles:
    """Joint angles over time: time_s (n,) rising, m names, values (n, m) [rad]; how many messages cannot be used."""

    time_s: NDArray[np.float64]
    names: tuple[str, ...]
    values: NDArray[np.float64]
    left_out: int = 0


def read_joint_angles(path: Path, known: Sequence[str]) -> JointAngles:
    """Read a run folder, a bag, an .mcap file or a CSV file; `known` are the names of the joint angles."""
    if path.suffix.lower() == ".csv":
        return _from_csv(path, known)
    return _from_bag(path, known)


def _from_bag(path: Path, known: Sequence[str]) -> JointAngles:
    """The first message of each stamp; time begins with the first message."""
    by_stamp: dict[int, Sequence[float]] = {}
    name = f"{namespace_of(read_bag(path), _TOPIC)}/{_TOPIC}"
    topic = read_bag(path, [name])[name]
    fitting = [message for message in topic.readable if message is not None and _fits(message, known)]
    if not fitting:
        raise RecordingError(
            f"{name} in {path} does not hold the {len(known)} joint angles of this version: record the run again"
        )
    for message in fitting:
        by_stamp.setdefault(stamp_ns(message.header.stamp), message.position)
    stamps = sorted(by_stamp)
    return JointAngles(
        time_s=np.array([seconds(stamp - stamps[0]) for stamp in stamps]),
        names=tuple(known),
        values=np.array([by_stamp[stamp] for stamp in stamps], dtype=float),
        left_out=len(topic) - len(fitting) + topic.left_out,
    )


def _fits(message: Any, known: Sequence[str]) -> bool:
    """True for finite values of the known joint angles in their order, with a stamp."""
    try:
        named = tuple(message.name) == tuple(known) and len(message.position) == len(known)
        return named and bool(np.isfinite(message.position).all()) and stamp_ns(message.header.stamp) >= 0
    except (AttributeError, TypeError):  # of another type
        return False


def _from_csv(path: Path, known: Sequence[str]) -> JointAngles:
    """Columns: `time_s`, then any of the known joint angles in degrees, with or without the ending _deg.

    Without it, angles that all fit radians are refused.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            lines = [(line, row) for line, row in enumerate(csv.reader(stream, strict=True), 1) if row]
    except (UnicodeDecodeError, csv.Error) as error:
        raise RecordingError(f"{path} is no CSV file in UTF-8 ({error}): save it as one") from error
    if len(lines) < 3:
        raise RecordingError(f"{path} has fewer than two postures: write a header and a line for each time")
    header = [cell.strip() for cell in lines[0][1]]
    names = _names(path, header, known)
    table = np.array([_numbers(path, line, header, row) for line, row in lines[1:]])
    if np.abs(table[:, 1:]).max() <= math.pi and not header[1].endswith(_SUFFIX):
        raise RecordingError(
            f"{path} has no angle beyond {math.pi:.4g}, as if it were in radians: write degrees, and name the columns"
            f" with their unit, as in {header[1]}{_SUFFIX}"
        )
    time_s = table[:, 0]
    for (line, _), before, after in zip(lines[2:], time_s, time_s[1:], strict=False):
        if after <= before:
            raise RecordingError(
                f"{path} line {line}, column {_TIME}: {after:g} is not above {before:g}; sort the"
                " lines by time"
            )
    return JointAngles(time_s, names, np.deg2rad(table[:, 1:]))


def _names(path: Path, header: Sequence[str], known: Sequence[str]) -> tuple[str, ...]:
    """Names of the joint angles in the header, without _deg."""
    if header[0] != _TIME or len(header) < 2:
        raise RecordingError(
            f"{path} line 1: the first column must be {_TIME} and joint angles must follow, it starts with"
            f" {header[0]!r}; write {_TIME},{known[0]},..."
        )
    names = tuple(name.removesuffix(_SUFFIX) for name in header[1:])
    for column, name in enumerate(names, 2):
        if name not in known:
            close = difflib.get_close_matches(name, known, 1)
            hint = f"did you mean {close[0]}" if close else f"write one like {known[0]}"
            raise RecordingError(f"{path} line 1, column {column}: there is no joint angle {name!r}, {hint}")
        if names.index(name) != column - 2:
            raise RecordingError(f"{path} line 1, column {column}: there are two columns {name}, delete one")
    return names


def _numbers(path: Path, line: int, header: Sequence[str], row: Sequence[str]) -> list[float]:
    if len(row) != len(header):
        raise RecordingError(
            f"{path} line {line} has {len(row)} columns, the header has {len(header)}: write a value for each"
        )
    numbers = []
    for name, cell in zip(header, row, strict=True):
        try:
            value = number(cell)
        except ValueError as error:
            raise RecordingError(
                f"{path} line {line}, column {name}: {cell.strip()!r} is no finite number, write one"
            ) from error
        if name != _TIME and abs(value) > _LARGEST_DEG:
            raise RecordingError(
                f"{path} line {line}, column {name}: {value:g} deg is beyond {_LARGEST_DEG:g}, write degrees"
            )
        numbers.append(value)
    return numbers
