# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc report``: the page of one recorded run, or of several beside each other."""

from collections.abc import Sequence
from pathlib import Path

import click

from skydiver_utc.cli import options
from skydiver_utc.cli.analyse import read


@click.command(cls=options.Computing, short_help="Make the report of a run, or compare several.")
@click.argument("folders", metavar="RUN...", nargs=-1, required=True, type=options.PATH)
@click.option(
    "--out", type=options.PATH, metavar="FILE.html",
    help="Write the page here instead of to report.html of the one RUN, or to comparison.html of several.",
)  # fmt: skip
def report(folders: Sequence[Path], out: Path | None) -> None:
    """Make the page of the recorded run RUN again, or one that compares several.

    The page is one file that opens offline: metrics, charts with one cursor, the body in 3-D, scenario and versions.
    """
    from skydiver_utc.parameters.files import write_file
    from skydiver_utc.parameters.run_folder import REPORT_FILE
    from skydiver_utc.view.report import report_html

    flown = [read(folder) for folder in folders]
    if len({one.name for one in flown}) < len(flown):  # runs of one scenario
        flown = [one._replace(name=folder.resolve().name) for one, folder in zip(flown, folders, strict=True)]
    path = out or (folders[0] / REPORT_FILE if len(folders) == 1 else Path("comparison.html"))
    write_file(path, report_html(flown))
    click.echo(str(path))
