# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc compare``: this package beside the paper."""

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from skydiver_utc.cli import options
from skydiver_utc.cli.outputs import prepare_folder
from skydiver_utc.cli.screen import count_progress, show_lines, table

if TYPE_CHECKING:
    from skydiver_utc.studies.paper_results import PaperResults

_STYLES = {"HOLDS": "green", "PARTLY": "yellow", "FAILS": "red", "ELSEWHERE": "dim"}


@click.group()
def compare() -> None:
    """Compare this package with the results of others."""


@compare.command(
    cls=options.Computing, short_help="Run every configuration and check every claim of the paper."
)
@options.out_folder
@click.option("--quick", is_flag=True, help="Only the first seconds of each run: does it all work?")
@options.workers
@options.as_json
@options.quiet
def paper(out: Path | None, quick: bool, workers: int, as_json: bool, quiet: bool) -> None:
    """Run every configuration of the paper: a table, its figures, and a checklist of its claims.

    FOLDER receives paper.md, details.md, results.json and the figures. Studies found there go into the pages.
    """
    from skydiver_utc.studies.checklist import checklist
    from skydiver_utc.studies.paper_cases import all_cases
    from skydiver_utc.studies.paper_files import read_comparison, write_comparison
    from skydiver_utc.studies.paper_results import run_comparison

    prepare_folder(out)
    with count_progress("runs", len(all_cases()), quiet) as done:
        results, runs = run_comparison(quick, workers, done)
    if out is not None:
        write_comparison(out, results, runs)
        results = read_comparison(out)
    if as_json:
        claims = [claim._asdict() for claim in checklist(results)]
        print(json.dumps(results.as_dict() | {"claims": claims}, indent=2))
        return
    _show(results)
    if out is not None:
        show_lines(f"written into {out}")


def _show(results: "PaperResults") -> None:
    from rich.console import Console
    from rich.text import Text

    from skydiver_utc.studies.checklist import checklist
    from skydiver_utc.studies.paper_page import CONFIGURATION_HEAD, QUICK_WARNING, configuration_rows

    head, *rows = (
        (label, *measured) for label, _code, *measured in (CONFIGURATION_HEAD, *configuration_rows(results))
    )
    configurations = table("Configurations", *head)
    for row in rows:
        configurations.add_row(*map(Text, row))
    claims = table("The paper's claims", "the paper's claim", "measured", "", show_lines=True)
    for claim in checklist(results):
        verdict = Text(claim.verdict.value, style=_STYLES[claim.verdict.name])
        claims.add_row(Text(claim.words), Text(claim.measured), verdict)
    Console().print(configurations)
    Console().print(claims)
    if results.quick:
        show_lines(QUICK_WARNING, style="bold red")
