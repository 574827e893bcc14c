"""What a verb shows: a progress bar on stderr, metrics on stdout."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from skydiver_utc.analysis.labels import rows
from skydiver_utc.parameters import Scenario

Progressed = Callable[[int, int], None]  # told (steps done, steps in all)


@contextmanager
def flight_progress(scenario: Scenario, quiet: bool) -> Iterator[Progressed]:
    """A bar that follows the steps of one flight; none when quiet or when stderr is no terminal."""
    console = Console(stderr=True)
    if quiet or not console.is_terminal:
        yield lambda _step, _steps: None
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TextColumn("{task.fields[flown]:.1f} of {task.fields[whole]:g} s simulated"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("getting ready", total=scenario.steps, flown=0.0, whole=scenario.duration_s)

        def progressed(step: int, steps: int) -> None:
            flown = step * scenario.dt_s
            bar.update(task, description=scenario.name, completed=step, total=steps, flown=flown)

        yield progressed


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
    console = Console()
    console.print(table)
    console.print(Text(values["reason"]), soft_wrap=True)


@contextmanager
def count_progress(description: str, total: int, quiet: bool) -> Iterator[Callable[[int], None]]:
    """A bar that is told how many of `total` are done; none when quiet or when stderr is no terminal."""
    console = Console(stderr=True)
    if quiet or not console.is_terminal:
        yield lambda _done: None
        return
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(description, total=total)
        yield lambda done: bar.update(task, completed=done)
