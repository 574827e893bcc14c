# SPDX-License-Identifier: Apache-2.0
"""References given as numbers, for one output or several: constants, points in time, a CSV table."""

import csv
import math
from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import model_validator
from typing_extensions import Self

from skydiver_utc.parameters.fields import quantity, text
from skydiver_utc.parameters.yaml_io import number as finite_number
from skydiver_utc.references.curve import Curve, CurveSettings
from skydiver_utc.references.profiles import Output, Seconds

_TIME = "time_s"
_IN_DEGREES = ("_deg_s", "_deg")


class Constant(CurveSettings):
    """Constant values of one or more outputs; a yaw rate of zero is a straight fall."""

    kind: Literal["constant"] = "constant"
    values: Annotated[dict[str, float], quantity("unit of the output", "value of each output, in its unit")]

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not self.values:
            raise ValueError("values is empty: name at least one output")
        return self

    def curve(self) -> Curve:
        values = np.array(list(self.values.values()))
        return Curve(tuple(self.values), np.abs(values), lambda time_s: values)


class Points(CurveSettings):
    """Straight lines between points in time, for example the pattern angle of an open-loop maneuver."""

    kind: Literal["points"] = "points"
    output: Output
    points: Annotated[tuple[tuple[Seconds, float], ...], text("time [s] and value of each point")]

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not self.points:
            raise ValueError("points is empty: give at least one, [time, value]")
        _refuse_disorder([time_s for time_s, _ in self.points], "the points")
        return self

    def curve(self) -> Curve:
        return _table((self.output,), [point[0] for point in self.points], [[p[1]] for p in self.points])


class Csv(CurveSettings):
    """Straight lines between the rows of a CSV table: `time_s`, then a column for each output, by its name.

    Columns are in the unit of the output, or in degrees (per second) where `_deg` (`_deg_s`) is added to the name.
    A scenario file gives the path, `file`, from its own folder; the scenario then holds the text itself.
    """

    kind: Literal["csv"] = "csv"
    table: Annotated[str, text("the text of the CSV table; a scenario file names a `file` instead")] = ""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not self.table:
            raise ValueError("file is missing: write the path of a CSV file")
        self.curve()
        return self

    def curve(self) -> Curve:
        """The table as a curve. Raises ValueError that names the line."""
        try:
            header, *rows = [row for row in csv.reader(self.table.splitlines()) if row] or [[]]
        except csv.Error as error:
            raise ValueError(f"the table is no CSV: {error}") from error
        names = [name.strip() for name in header]
        if len(names) < 2 or names[0] != _TIME or not all(names):
            raise ValueError(f"the header of the table is {names}: write {_TIME} and the names of outputs")
        if not rows:
            raise ValueError("the table has no rows: write at least one below the header")
        numbers = np.array([_numbers(row, number, len(names)) for number, row in enumerate(rows, 2)])
        times = numbers[:, 0].tolist()
        _refuse_disorder(times, "the rows of the table")
        columns = [_column(name) for name in names[1:]]
        outputs = tuple(output for output, _ in columns)
        if len(set(outputs)) < len(outputs):
            raise ValueError(f"the table has a column twice, {', '.join(outputs)}: keep one of each")
        return _table(outputs, times, numbers[:, 1:] * [scale for _, scale in columns])


def _numbers(row: list[str], number: int, count: int) -> list[float]:
    """The numbers of a row of the table; the header is row 1."""
    if len(row) != count:
        raise ValueError(f"row {number} of the table has {len(row)} entries, its header {count}")
    try:
        return [finite_number(entry) for entry in row]
    except ValueError as error:
        raise ValueError(f"row {number} of the table has an entry that is no number: {error}") from error


def _column(name: str) -> tuple[str, float]:
    """Output of a column, and the factor to its unit."""
    for ending in _IN_DEGREES:
        if name.endswith(ending):
            return name.removesuffix(ending), math.radians(1.0)
    return name, 1.0


def _refuse_disorder(times: list[float], name: str) -> None:
    if any(after <= before for before, after in pairwise(times)):
        raise ValueError(f"{name} must be in the order of growing time: sort them")


def _table(outputs: tuple[str, ...], times: list[float], values: Any) -> Curve:
    """Straight lines between rows (l,); constant before the first and after the last."""
    rows, at = np.array(values, dtype=np.float64), np.array(times)
    columns = rows.T.copy()
    return Curve(
        outputs,
        np.abs(rows).max(axis=0),
        lambda time_s: np.array([np.interp(time_s, at, column) for column in columns]),
    )
