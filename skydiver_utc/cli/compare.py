# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc compare``: this package beside the paper."""

import json
from pathlib import Path

import click

from skydiver_utc.cli import options
from skydiver_utc.cli.outputs import prepare_folder
from skydiver_utc.cli.screen import count_progress


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
    """Run every configuration of the paper, random tunings and plants with other numbers; decide the paper's claims.

    FOLDER receives paper.md, details.md, results.json and the figures. Takes some twenty minutes.
    """
    from skydiver_utc.studies.paper_files import write_comparison
    from skydiver_utc.studies.paper_page import checklist, page
    from skydiver_utc.studies.paper_results import flights, run_comparison

    prepare_folder(out)
    wanted = flights(quick)
    with count_progress("runs", len(wanted), quiet) as done:
        results = run_comparison(wanted, quick, workers, done)
    if out is not None:
        write_comparison(out, results)
    if as_json:
        claims = [claim._asdict() for claim in checklist(results)]
        print(json.dumps(results.as_dict() | {"claims": claims}, indent=2))
        return
    from rich.console import Console
    from rich.markdown import Markdown

    Console().print(Markdown(page(results)))
