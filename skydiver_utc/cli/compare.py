# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc compare``: this package beside the paper."""

import json
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from skydiver_utc.cli.outputs import prepare_folder
from skydiver_utc.cli.screen import count_progress
from skydiver_utc.studies.checklist import checklist
from skydiver_utc.studies.claim import Verdict
from skydiver_utc.studies.paper_cases import all_cases
from skydiver_utc.studies.paper_files import read_comparison, write_comparison
from skydiver_utc.studies.paper_page import CONFIGURATION_HEAD, QUICK_WARNING, configuration_rows
from skydiver_utc.studies.paper_results import PaperResults, run_comparison

_STYLES = {Verdict.HOLDS: "green", Verdict.PARTLY: "yellow", Verdict.FAILS: "red", Verdict.ELSEWHERE: "dim"}


def compare_paper(out: Path | None, quick: bool, jobs: int, as_json: bool, quiet: bool) -> None:
    """Run the comparison, write page, results and figures to `out`, print configurations and checklist."""
    prepare_folder(out)
    with count_progress("runs", len(all_cases()), quiet) as done:
        results, runs = run_comparison(quick, jobs, done)
    if out is not None:
        write_comparison(out, results, runs)
        results = read_comparison(out)
    if as_json:
        claims = [claim._asdict() for claim in checklist(results)]
        print(json.dumps(results.as_dict() | {"claims": claims}, indent=2))
        return
    _show(results)
    if out is not None:
        Console().print(Text(f"written into {out}"), soft_wrap=True)


def _show(results: PaperResults) -> None:
    console = Console()
    configurations = Table(title="Configurations", title_justify="left", title_style="bold")
    head, *rows = (
        (label, *measured) for label, _code, *measured in (CONFIGURATION_HEAD, *configuration_rows(results))
    )
    for name in head:
        configurations.add_column(name)
    for row in rows:
        configurations.add_row(*map(Text, row))
    claims = Table(title="The paper's claims", title_justify="left", title_style="bold", show_lines=True)
    for name in ("the paper's claim", "measured", ""):
        claims.add_column(name)
    for claim in checklist(results):
        verdict = Text(claim.verdict.value, style=_STYLES[claim.verdict])
        claims.add_row(Text(claim.words), Text(claim.measured), verdict)
    console.print(configurations)
    console.print(claims)
    if results.quick:
        console.print(Text(QUICK_WARNING, style="bold red"), soft_wrap=True)
