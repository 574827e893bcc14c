# SPDX-License-Identifier: Apache-2.0
"""Joint angles over time, from a recording, a CSV file or a motion file of OpenSim."""

import csv
import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.errors import RecordingError, hint
from skydiver_utc.messages.named import read_named
from skydiver_utc.parameters.nanoseconds import seconds, stamp_ns
from skydiver_utc.recording.number_table import numbers, refuse_twice, text_of
from skydiver_utc.recording.opensim import ENDINGS, read_opensim
from skydiver_utc.recording.reader import namespace_of, read_bag

_TOPIC = "joint_states"
_TIME = "time_s"
_SUFFIX = "_deg"


@dataclass(frozen=True, eq=False)
class JointAngles:
    """Joint angles over time: time_s (n,) rising, m names, values (n, m) [rad]; in words, what was left out."""

    time_s: Array
    names: tuple[str, ...]
    values: Array
    note: str = ""


def read_joint_angles(path: Path, known: Sequence[str]) -> JointAngles:
    """Read a run folder, a bag, or an .mcap, CSV, .mot or .sto file; `known` are the names of the joint angles."""
    if path.suffix.lower() == ".csv":
        return _from_csv(path, known)
    if path.suffix.lower() in ENDINGS:
        return JointAngles(*read_opensim(path))
    return _from_bag(path, known)


def _from_bag(path: Path, known: Sequence[str]) -> JointAngles:
    """The first message of each stamp; time begins with the first message."""
    by_stamp: dict[int, Array] = {}
    name = f"{namespace_of(read_bag(path), _TOPIC)}/{_TOPIC}"
    topic = read_bag(path, [name])[name]
    fitting = 0
    for message in filter(None, topic.readable):
        with suppress(AttributeError, TypeError, ValueError):  # of other joints, or of another type
            values = read_named(message, known)
            by_stamp.setdefault(stamp_ns(message.header.stamp), values)
            fitting += 1
    if not fitting:
        raise RecordingError(
            f"{name} in {path} does not hold the {len(known)} joint angles of this version: record the run again"
        )
    stamps = sorted(by_stamp)
    left_out = len(topic) - fitting + topic.left_out
    return JointAngles(
        time_s=np.array([seconds(stamp - stamps[0]) for stamp in stamps]),
        names=tuple(known),
        values=np.array([by_stamp[stamp] for stamp in stamps]),
        note=f"{left_out} recorded postures cannot be used and are left out" if left_out else "",
    )


def _from_csv(path: Path, known: Sequence[str]) -> JointAngles:
    """Columns: `time_s`, then angles in degrees; without the ending _deg, angles that all fit radians are refused."""
    try:
        rows = csv.reader(StringIO(text_of(path), newline=""), strict=True)
        lines = [(line, row) for line, row in enumerate(rows, 1) if row]
    except csv.Error as error:
        raise RecordingError(f"{path} is no CSV file ({error}): save it as one") from error
    header = [cell.strip() for cell in lines[0][1]] if lines else []
    names = _names(path, header, known) if lines else ()
    table = numbers(path, header, range(len(header)), lines[1:])
    if np.abs(table[:, 1:]).max() <= math.pi and not header[1].endswith(_SUFFIX):
        raise RecordingError(
            f"{path} has no angle beyond {math.pi:.4g}, as if it were in radians: write degrees, and name the columns"
            f" with their unit, as in {header[1]}{_SUFFIX}"
        )
    return JointAngles(table[:, 0], names, np.deg2rad(table[:, 1:]))


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
            advice = hint(name, known, f"write one like {known[0]}")
            raise RecordingError(
                f"{path} line 1, column {column}: there is no joint angle {name!r}, {advice}"
            )
    refuse_twice(path, 1, [_TIME, *names])
    return names
