# SPDX-License-Identifier: Apache-2.0
"""Progress bars on stderr, metrics on stdout; rich is imported when something is shown."""

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from skydiver_utc.cli.errors import printable

if TYPE_CHECKING:
    from rich.table import Column, Table
    from rich.text import Text

# Wider than any table [columns].
_WIDEST = 1000
# By the ending of a name.
_UNITS = {
    "_rad_s2": "rad/s2", "_m_s2": "m/s2", "_deg_s": "deg/s", "_m_s": "m/s", "_1_s": "1/s", "_kg_m3": "kg/m3",
    "_kg_m2": "kg m2", "_deg": "deg", "_rad": "rad", "_kg": "kg", "_hz": "Hz", "_s": "s", "_m": "m",
}  # fmt: skip


@contextmanager
def count_progress(description: str, total: int, quiet: bool) -> Iterator[Callable[..., None]]:
    """A bar of `total` items, called with those done and a new description; none when quiet or without a terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    # Older versions of rich end a disabled bar with an empty line.
    console.quiet = quiet or not console.is_terminal
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True, disable=console.quiet) as bars:
        task = bars.add_task(description, total=total)
        yield lambda done, now=None: bars.update(task, completed=done, description=now)


def table(title: str, *columns: "Column | str", **options: Any) -> "Table":
    """A table with these headings."""
    from rich.table import Table
    from rich.text import Text

    return Table(
        *columns, title=Text(title) if title else None, title_justify="left", title_style="bold", **options
    )


def facts(title: str = "") -> "Table":
    """A table of three columns without headings: a name, a value, and its unit or a remark."""
    made = table(title, show_header=False)
    made.add_column(no_wrap=True)
    made.add_column(justify="right", overflow="fold")
    made.add_column(style="dim")
    return made


def show_lines(*lines: str) -> None:
    """Print lines on stdout, however long."""
    from rich.console import Console
    from rich.text import Text

    for line in lines:
        Console().print(Text(printable(line)), soft_wrap=True)


def show_values(values: Mapping[str, Any], as_json: bool, *left_out: str) -> None:
    """Print plain data as one JSON object, or on the screen without the names that are left out.

    On the screen each value is a row with its unit, which its name ends in; blocks of the same fields are a table.
    """
    if as_json:
        print(json.dumps(values, indent=2))
        return
    from rich.table import Column

    made, tables = facts(), []
    for name, value in _flat(values, left_out):
        blocks = _blocks(value)
        if blocks is None:
            label, unit = _in_words(name)
            made.add_row(label, _text(value, unit), unit)
        elif blocks:
            rows = [dict(_flat(block, left_out)) for block in blocks]
            names = dict.fromkeys(name for row in rows for name in row)
            headings = (Column(" ".join(_in_words(name)).strip(), justify="right") for name in names)
            tables.append(table(_in_words(name)[0], *headings, show_edge=False, padding=0))
            for row in rows:
                tables[-1].add_row(*(_text(row.get(name), _in_words(name)[1]) for name in names))
    show_tables(made, *tables)


def _flat(values: Mapping[str, Any], left_out: Sequence[str]) -> Iterator[tuple[str, Any]]:
    """The values of a block and of the blocks in it, but for tables."""
    for name, value in values.items():
        if name in left_out:
            continue
        if isinstance(value, Mapping) and _blocks(value) is None:
            yield from ((f"{name} {inner}", value) for inner, value in _flat(value, left_out))
        else:
            yield name, value


def _blocks(value: object) -> list[Mapping[str, Any]] | None:
    """The rows of a table: a list of blocks, or blocks by name; None for anything else."""
    if isinstance(value, Mapping) and all(isinstance(block, Mapping) for block in value.values()):
        return [{"": name, **block} for name, block in value.items()]
    if isinstance(value, list) and all(isinstance(block, Mapping) for block in value):
        return value
    return None


def _in_words(name: str) -> tuple[str, str]:
    """A name in words, and the unit that it ends in."""
    for ending, unit in _UNITS.items():
        if name.endswith(ending):
            return name.removesuffix(ending).replace("_", " "), unit
    first, *rest = name.split(" ")
    return " ".join([first.replace("_", " ") if rest or not re.search("[./]", first) else first, *rest]), ""


def _text(value: object, unit: str = "") -> "Text":
    """A value on the screen: four digits, of a time all milliseconds."""
    from rich.text import Text

    if isinstance(value, bool):
        return Text("yes", style="green") if value else Text("no", style="red")
    if isinstance(value, list):
        return Text("  ").join(_text(item, unit) for item in value)
    if isinstance(value, float):
        is_time = unit == "s" and abs(value) >= 1.0
        return Text(f"{round(value, 3):.12g}" if is_time else f"{round(value, 12) + 0.0:.4g}")
    return Text("-" if value is None else printable(str(value)))


def show_metrics(values: dict[str, Any], title: str) -> None:
    """Print the metrics as a table."""
    from rich.text import Text

    from skydiver_utc.analysis.labels import missing, rows

    made = facts(title)
    style = "green" if values["outcome"] == "completed" else "red"
    made.add_row("outcome", Text(values["outcome"], style=style), "")
    for row in rows(values):
        made.add_row(*(Text(printable(cell)) for cell in row))
    show_tables(made)
    show_lines(*filter(None, (values["reason"], missing(values))))


def show_tables(*tables: "Table") -> None:
    """Print tables on stdout; on a narrow screen lines get too long, but no word is cut."""
    from rich.cells import cell_len
    from rich.console import Console
    from rich.measure import Measurement

    console = Console()
    for each in tables:
        for column in each.columns:
            lines = [line for cell in (column.header, *column.cells) for line in str(cell).splitlines()]
            whole = lines if column.no_wrap else [word for line in lines for word in line.split()]
            column.min_width = max(map(cell_len, whole), default=0)
        least = Measurement.get(console, console.options.update(max_width=_WIDEST), each).minimum
        Console(width=max(console.width, least)).print(each, crop=False)
