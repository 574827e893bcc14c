# SPDX-License-Identifier: Apache-2.0
"""Progress bars on stderr, metrics on stdout; rich is imported when something is shown."""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from skydiver_utc.cli.errors import printable

if TYPE_CHECKING:
    from rich.progress import Progress, ProgressColumn
    from rich.table import Table

    from skydiver_utc.parameters import Scenario

Progressed = Callable[[int, int], None]  # called with (steps done, steps in all)
# Wider than any table [columns].
_WIDEST = 1000


@contextmanager
def run_progress(scenario: "Scenario", quiet: bool) -> Iterator[Progressed]:
    """A bar for the steps of a run; none when quiet or when stderr is no terminal."""
    from rich.progress import TextColumn

    columns = (
        TextColumn("{task.percentage:>3.0f} %"),
        TextColumn("{task.fields[done]:.1f} of {task.fields[whole]:g} s simulated"),
    )
    with _bars(columns, quiet) as bars:
        task = bars.add_task("getting ready", total=scenario.steps, done=0.0, whole=scenario.duration_s)
        yield lambda step, steps: bars.update(
            task, description=scenario.name, completed=step, total=steps, done=step * scenario.dt_s
        )


@contextmanager
def count_progress(description: str, total: int, quiet: bool) -> Iterator[Callable[..., None]]:
    """A bar for `total` items, called with those done and, where it changes, the description.

    None when quiet or when stderr is no terminal.
    """
    from rich.progress import MofNCompleteColumn, TimeRemainingColumn

    with _bars((MofNCompleteColumn(), TimeRemainingColumn()), quiet) as bars:
        task = bars.add_task(description, total=total)
        yield lambda done, now=None: bars.update(task, completed=done, description=now)


def _bars(columns: Sequence["ProgressColumn"], quiet: bool) -> "Progress":
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    every = (TextColumn("{task.description}", markup=False), BarColumn(), *columns, TimeElapsedColumn())
    # Older versions of rich end a disabled bar with an empty line.
    console.quiet = quiet or not console.is_terminal
    return Progress(*every, console=console, transient=True, disable=console.quiet)


def table(title: str, *columns: str, **options: Any) -> "Table":
    """A table; a column whose heading begins with ">" is set to the right."""
    from rich.table import Table
    from rich.text import Text

    made = Table(title=Text(title) if title else None, title_justify="left", title_style="bold", **options)
    for column in columns:
        made.add_column(column.removeprefix(">"), justify="right" if column.startswith(">") else "left")
    return made


def facts(title: str = "", **options: Any) -> "Table":
    """A table of three columns without headings: a name, a value, and its unit or a remark."""
    made = table(title, show_header=False, **options)
    made.add_column(no_wrap=True)
    made.add_column(justify="right", overflow="fold")
    made.add_column(style="dim")
    return made


def numbers(values: Iterable[float], digits: int) -> str:
    """Numbers with so many decimals, none of them -0.0."""
    return "  ".join(f"{round(value, digits) + 0.0:.{digits}f}" for value in values)


def show_lines(*lines: str, style: str = "") -> None:
    """Print lines on stdout, however long."""
    from rich.console import Console
    from rich.text import Text

    for line in lines:
        Console().print(Text(printable(line), style=style), soft_wrap=True)


def show_json_or(values: Mapping[str, Any], as_json: bool, show: Callable[[dict[str, Any]], None]) -> None:
    """Print values as one JSON object, or let `show` print them."""
    if as_json:
        print(json.dumps(values, indent=2))
    else:
        show(dict(values))


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
