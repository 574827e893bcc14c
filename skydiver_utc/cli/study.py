# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc study``: many runs for one question."""

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import click

from skydiver_utc.cli import options
from skydiver_utc.cli.outputs import prepare_folder
from skydiver_utc.cli.screen import count_progress, table
from skydiver_utc.cli.settings import load_skydiver
from skydiver_utc.cli.study_run import run_study, show_run

if TYPE_CHECKING:
    from skydiver_utc.studies.tuning import TuningSummary


@click.group()
def study() -> None:
    """Answer one question with many runs."""


study.add_command(run_study)
study.add_command(show_run)


@study.command(cls=options.Computing, short_help="Run with random covariances.")
@click.option(
    "--scenario", "names", multiple=True, show_default=True,
    default=(
        "fast_turn_unknown_dynamics", "fast_turn_pi_dynamics",
        "fast_turn_unknown_dynamics_insensitive", "fast_turn_pi_dynamics_insensitive",
    ),
    metavar="SCENARIO", help="What is tuned. Repeatable.",
)  # fmt: skip
@options.settings
@click.option(
    "--factor", "reaches", multiple=True, default=(3.0,), show_default=True,
    type=click.FloatRange(1.0, 100.0, min_open=True),
    help="Largest factor on a covariance, and the inverse of the smallest. Repeatable.",
)  # fmt: skip
@click.option("--count", default=200, show_default=True, type=click.IntRange(2), help="Tunings per scenario.")
@options.seed
@options.out_folder
@options.workers
@options.as_json
@options.quiet
def tuning(
    names: Sequence[str],
    settings: Sequence[str],
    reaches: Sequence[float],
    count: int,
    seed: int,
    out: Path | None,
    workers: int,
    as_json: bool,
    quiet: bool,
) -> None:
    """Run SCENARIO with random tunings: each covariance times a factor of its own, log-uniform.

    FOLDER receives tuning.json, tuning.png and a table of every run.
    """
    from skydiver_utc.studies.tuning import check_tunable, summarise, tune
    from skydiver_utc.studies.tuning_files import summaries_to_json, write_study

    scenarios = [check_tunable(load_skydiver(name, settings)) for name in names]
    prepare_folder(out)
    tunings = []
    for scenario, reach in product(scenarios, reaches):
        with count_progress(f"{scenario.name}, factor {reach:g}", count + 1, quiet) as done:
            tunings.append(tune(scenario, reach, count, seed, workers, done))
    summaries = [summarise(one) for one in tunings]
    if out is not None:
        write_study(out, tunings, summaries)
    if as_json:
        print(summaries_to_json(summaries), end="")
    else:
        _show(summaries)


@study.command(cls=options.Computing, short_help="Run on plants with other numbers.")
@options.out_folder
@options.workers
@options.quiet
def sensitivity(out: Path | None, workers: int, quiet: bool) -> None:
    """Run the paper's configurations with the plant's calibrated numbers 10 % off, one by one and all at once.

    FOLDER receives sensitivity.json. Takes some ten minutes.
    """
    from skydiver_utc.studies.sensitivity import (
        calibrations,
        fly_calibrations,
        sensitivity_section,
        write_sensitivity,
    )

    prepare_folder(out)
    with count_progress("calibrations and runs", 7 * len(calibrations()), quiet) as done:
        found = fly_calibrations(workers, done)
    if out is not None:
        write_sensitivity(out, found)
    print(sensitivity_section(found))


def _show(summaries: "Sequence[TuningSummary]") -> None:
    from rich.console import Console
    from rich.text import Text

    from skydiver_utc.studies.tuning_files import count_rows, head, influence_rows

    for title, rows in (
        ("Random tunings", count_rows(summaries)),
        ("Rank correlation of each factor with the RMSE", influence_rows(summaries)),
    ):
        made = table(title, *head(summaries))
        for row in rows:
            made.add_row(*map(Text, row))
        Console().print(made)
