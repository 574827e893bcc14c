# SPDX-License-Identifier: Apache-2.0
"""The ledger of a study: one SQLite file, one row for each run that has ended, written by one process."""

import json
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from skydiver_utc.parameters import ParameterError

FILE = "ledger.sqlite"
FAILED = "failed"  # the outcome of a run that raised an error
_TABLES = """
create table if not exists study (digest text, name text);
create table if not exists runs (number integer primary key, case_name text, sample text, outcome text,
    success integer, metrics text, sentence text, trace text, cpu_s real);
"""


class Row(NamedTuple):
    """A run: its number, case, varied values, end, kept metrics, one sentence, trace of an error, CPU time [s]."""

    number: int
    case: str
    sample: dict[str, Any]
    outcome: str
    success: bool
    metrics: dict[str, Any]
    sentence: str
    trace: str
    cpu_s: float


class Ledger:
    """Rows by number; a row outlives this process when `add` returns."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection

    def add(self, row: Row) -> None:
        """Write a row."""
        plain = [json.dumps(value) if isinstance(value, dict) else value for value in row]
        self._connection.execute(f"insert or replace into runs values ({','.join('?' * len(plain))})", plain)
        self._connection.commit()

    def rows(self) -> list[Row]:
        """All rows, by number."""
        return [
            Row(n, case, json.loads(sample), outcome, bool(success), json.loads(metrics), *rest)
            for n, case, sample, outcome, success, metrics, *rest in self._connection.execute(
                "select * from runs order by number"
            )
        ]


@contextmanager
def ledger(folder: Path, name: str, digest: str) -> Iterator[Ledger]:
    """The ledger of a study in a folder, begun or continued; another study's is refused."""
    path = folder / FILE
    try:
        connection = sqlite3.connect(path)
    except sqlite3.Error as error:
        raise ParameterError(f"{path} cannot be used ({error}): choose another --out") from error
    try:
        try:
            connection.execute("pragma journal_mode = wal")
            # A row outlives this process at once, and a failure of the machine when the system next writes to the disk.
            connection.execute("pragma synchronous = normal")
            connection.executescript(_TABLES)
            known = connection.execute("select digest, name from study").fetchone()
        except sqlite3.Error as error:
            raise ParameterError(f"{path} is no ledger ({error}): choose another --out") from error
        if known is None:
            connection.execute("insert into study values (?, ?)", (digest, name))
            connection.commit()
        elif known[0] != digest:
            raise ParameterError(
                f"{path} holds runs of another study or calibration ({known[1]}), or of other settings:"
                " choose another --out"
            )
        yield Ledger(connection)
    finally:
        connection.close()
