"""``skydiver-utc study``: many flights for one question."""

from collections.abc import Sequence
from itertools import product
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from skydiver_utc.studies.guide import STEPS, flights_in_guide, fly_guide
from skydiver_utc.studies.tuning import check_tunable, tune
from skydiver_utc.studies.tuning_files import summaries_to_json, write_study
from skydiver_utc.studies.tuning_page import count_rows, head, influence_rows
from skydiver_utc.studies.tuning_summary import TuningSummary, summarise
from skydiver_utc.verbs.outputs import prepared_folder
from skydiver_utc.verbs.screen import count_progress
from skydiver_utc.verbs.settings import load


def study_tuning(
    names: Sequence[str],
    settings: Sequence[str],
    reaches: Sequence[float],
    count: int,
    seed: int,
    out: Path | None,
    jobs: int,
    as_json: bool,
    quiet: bool,
) -> None:
    """Fly each scenario with the same random tunings, write what came of it to `out`, print the summary."""
    scenarios = [check_tunable(load(name, settings)) for name in names]
    if out is not None:
        prepared_folder(out)
    tunings = []
    for scenario, reach in product(scenarios, reaches):
        with count_progress(f"{scenario.name}, factor {reach:g}", count + 1, quiet) as done:
            tunings.append(tune(scenario, reach, count, seed, jobs, done))
    summaries = [summarise(one) for one in tunings]
    if out is not None:
        write_study(out, tunings, summaries)
    if as_json:
        print(summaries_to_json(summaries), end="")
    else:
        _show(summaries)


def study_guide(out: Path, jobs: int, quiet: bool) -> None:
    """Draw the tuning guide's figures into `out`."""
    from skydiver_utc.analysis.style import png
    from skydiver_utc.analysis.telemetry_figure import telemetry_figure

    folder = prepared_folder(out)
    with count_progress("flights", flights_in_guide(), quiet) as done:
        flown = fly_guide(jobs, done)
    for step in STEPS:
        flights = {label: flown[one.command] for label, one in step.flights.items()}
        (folder / f"{step.name}.png").write_bytes(png(telemetry_figure(step.title, flights)))


def _show(summaries: Sequence[TuningSummary]) -> None:
    console = Console()
    for title, rows in (
        ("Random tunings", count_rows(summaries)),
        (
            "Rank correlation with the RMSE; converged in each quarter",
            influence_rows(summaries),
        ),
    ):
        table = Table(title=title, title_justify="left", title_style="bold")
        for name in head(summaries):
            table.add_column(name)
        for row in rows:
            table.add_row(*map(Text, row))
        console.print(table)
