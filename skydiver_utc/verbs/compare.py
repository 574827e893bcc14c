"""``skydiver-utc compare``: this package beside the paper."""

from pathlib import Path

import msgspec
from rich.console import Console
from rich.table import Table
from rich.text import Text

from skydiver_utc.studies import paper_runs as flown
from skydiver_utc.studies.checklist import checklist
from skydiver_utc.studies.claim import Verdict
from skydiver_utc.studies.paper_files import read_comparison, write_comparison
from skydiver_utc.studies.paper_page import CONFIGURATION_HEAD, QUICK_WARNING, configuration_rows
from skydiver_utc.studies.paper_results import PaperResults, fly_comparison
from skydiver_utc.verbs.outputs import prepared_folder
from skydiver_utc.verbs.screen import count_progress

_STYLES = {Verdict.HOLDS: "green", Verdict.PARTLY: "yellow", Verdict.FAILS: "red", Verdict.ELSEWHERE: "dim"}


def compare_paper(out: Path | None, quick: bool, jobs: int, as_json: bool, quiet: bool) -> None:
    """Fly the comparison, write page, results and figures to `out`, print configurations and checklist."""
    if out is not None:
        prepared_folder(out)
    with count_progress("flights", len(flown.all_runs()), quiet) as done:
        results, flights = fly_comparison(quick, jobs, done)
    if out is not None:
        write_comparison(out, results, flights)
        results = read_comparison(out)
    if as_json:
        content = msgspec.to_builtins(results) | {"claims": [claim._asdict() for claim in checklist(results)]}
        print(msgspec.json.format(msgspec.json.encode(content), indent=2).decode())
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
    for name in ("the paper says", "measured", ""):
        claims.add_column(name)
    for claim in checklist(results):
        claims.add_row(
            Text(claim.words), Text(claim.measured), Text(claim.verdict.value, style=_STYLES[claim.verdict])
        )
    console.print(configurations)
    console.print(claims)
    if results.quick:
        console.print(Text(QUICK_WARNING, style="bold red"), soft_wrap=True)
