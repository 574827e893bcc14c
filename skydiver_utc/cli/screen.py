# SPDX-License-Identifier: Apache-2.0
"""Progress bars on stderr, metrics on stdout."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from rich.cells import cell_len
from rich.console import Console
from rich.measure import Measurement
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from skydiver_utc.analysis.labels import missing, rows
from skydiver_utc.parameters import Scenario

Progressed = Callable[[int, int], None]  # called with (steps done, steps in all)
# Wider than any table [columns].
_WIDEST = 1000


@contextmanager
def flight_progress(scenario: Scenario, quiet: bool) -> Iterator[Progressed]:
    """A bar for the steps of one run; none when quiet or when stderr is no terminal."""
    with flights_progress({scenario.name: scenario}, quiet) as progressed:
        yield progressed[scenario.name]


@contextmanager
def flights_progress(scenarios: Mapping[str, Scenario], quiet: bool) -> Iterator[dict[str, Progressed]]:
    """A bar for each run, by name; none when quiet or when stderr is no terminal."""
    console = Console(stderr=True)
    if quiet or not console.is_terminal:
        yield {name: lambda _step, _steps: None for name in scenarios}
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TextColumn("{task.fields[flown]:.1f} of {task.fields[whole]:g} s simulated"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        yield {name: _bar_of(bar, name, scenario) for name, scenario in scenarios.items()}


def _bar_of(bar: Progress, name: str, scenario: Scenario) -> Progressed:
    task = bar.add_task("getting ready", total=scenario.steps, flown=0.0, whole=scenario.duration_s)

    def progressed(step: int, steps: int) -> None:
        bar.update(task, description=name, completed=step, total=steps, flown=step * scenario.dt_s)

    return progressed


def show_metrics(values: dict[str, Any], title: str) -> None:
    """Print the metrics as a table."""
    table = Table(title=Text(title), title_justify="left", title_style="bold", show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(justify="right", overflow="fold")
    table.add_column(style="dim")
    style = "green" if values["outcome"] == "completed" else "red"
    table.add_row("outcome", Text(values["outcome"], style=style), "")
    for row in rows(values):
        table.add_row(*row)
    show_tables(table)
    for sentence in filter(None, (values["reason"], missing(values))):
        Console().print(Text(sentence), soft_wrap=True)


def show_tables(*tables: Table) -> None:
    """Print tables on stdout; on a narrow screen lines get too long, but no word is cut."""
    console = Console()
    for table in tables:
        for column in table.columns:
            lines = [line for cell in (column.header, *column.cells) for line in str(cell).splitlines()]
            whole = lines if column.no_wrap else [word for line in lines for word in line.split()]
            column.min_width = max(map(cell_len, whole), default=0)
        least = Measurement.get(console, console.options.update(max_width=_WIDEST), table).minimum
        Console(width=max(console.width, least)).print(table, crop=False)


@contextmanager
def count_progress(description: str, total: int, quiet: bool) -> Iterator[Callable[[int], None]]:
    """A bar for `total` items; none when quiet or when stderr is no terminal."""
    console = Console(stderr=True)
    if quiet or not console.is_terminal:
        yield lambda _done: None
        return
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(description, total=total)
        yield lambda done: bar.update(task, completed=done)
