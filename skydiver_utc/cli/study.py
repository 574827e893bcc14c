# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc study``: many runs for one question."""

from collections.abc import Sequence
from itertools import product
from pathlib import Path

from rich.console import Console
from rich.text import Text

from skydiver_utc.cli.outputs import prepare_folder
from skydiver_utc.cli.screen import count_progress, table
from skydiver_utc.cli.settings import load_skydiver
from skydiver_utc.studies.sensitivity import (
    calibrations,
    fly_calibrations,
    sensitivity_section,
    write_sensitivity,
)
from skydiver_utc.studies.tuning import check_tunable, tune
from skydiver_utc.studies.tuning_files import summaries_to_json, write_study
from skydiver_utc.studies.tuning_page import count_rows, head, influence_rows
from skydiver_utc.studies.tuning_summary import TuningSummary, summarise


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
    """Run each scenario with the same random tunings, write the results to `out`, print the summary."""
    scenarios = [check_tunable(load_skydiver(name, settings)) for name in names]
    prepare_folder(out)
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


def study_sensitivity(out: Path | None, jobs: int, quiet: bool) -> None:
    """Fly the paper's configurations on plants with other numbers, write and print what is left of the results."""
    prepare_folder(out)
    with count_progress("calibrations and runs", 7 * len(calibrations()), quiet) as done:
        found = fly_calibrations(jobs, done)
    if out is not None:
        write_sensitivity(out, found)
    print(sensitivity_section(found))


def _show(summaries: Sequence[TuningSummary]) -> None:
    for title, rows in (
        ("Random tunings", count_rows(summaries)),
        ("Rank correlation of each factor with the RMSE", influence_rows(summaries)),
    ):
        made = table(title, *head(summaries))
        for row in rows:
            made.add_row(*map(Text, row))
        Console().print(made)
