# SPDX-License-Identifier: Apache-2.0
"""Tables of angles over time in text files; an error names the line and the column."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.errors import RecordingError
from skydiver_utc.parameters.yaml_io import number

_LARGEST_DEG = 180.0


def text_of(path: Path) -> str:
    """The text of a file in UTF-8, with or without a byte order mark."""
    try:
        return path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise RecordingError(f"{path} is not in UTF-8 ({error}): save it as a text in UTF-8") from error


def refuse_twice(path: Path, line: int, names: Sequence[str]) -> None:
    """Refuse a header that names two columns alike."""
    for column, name in enumerate(names):
        if names.index(name) != column:
            raise RecordingError(
                f"{path} line {line}, column {column + 1}: there are two columns {name}, delete one"
            )


def numbers(
    path: Path,
    header: Sequence[str],
    columns: Sequence[int],
    lines: Sequence[tuple[int, Sequence[str]]],
    degrees: float = 1.0,
) -> Array:
    """Numbers (n, m) of some columns of numbered lines: the time, then angles in degrees, whose unit is `degrees`."""
    if len(lines) < 2:
        raise RecordingError(f"{path} has fewer than two postures: write a header and a line for each time")
    rows: list[list[float]] = []
    for line, cells in lines:
        if len(cells) != len(header):
            raise RecordingError(
                f"{path} line {line} has {len(cells)} columns, the header has {len(header)}: write a value for each"
            )
        row: list[float] = []
        for column in columns:
            place = f"{path} line {line}, column {header[column]}"
            try:
                value = number(cells[column])
            except ValueError as error:
                raise RecordingError(
                    f"{place}: {cells[column].strip()!r} is no finite number, write one"
                ) from error
            if row and abs(value := value * degrees) > _LARGEST_DEG:
                raise RecordingError(
                    f"{place}: {value:g} deg is beyond {_LARGEST_DEG:g}, write the angle in the unit of the file"
                )
            row.append(value)
        if rows and row[0] <= rows[-1][0]:
            raise RecordingError(
                f"{path} line {line}, column {header[columns[0]]}: {row[0]:g} is not above {rows[-1][0]:g}; sort the"
                " lines by time"
            )
        rows.append(row)
    return np.array(rows)
