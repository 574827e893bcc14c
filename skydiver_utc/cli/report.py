# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc report``: the page of one recorded run, or of several beside each other."""

from collections.abc import Sequence
from pathlib import Path

import click

from skydiver_utc.cli.analyse import read
from skydiver_utc.parameters.files import write_file
from skydiver_utc.parameters.run_folder import REPORT_FILE
from skydiver_utc.view.report import report_html


def report(folders: Sequence[Path], out: Path | None) -> None:
    """Write the page, print its name."""
    flown = [read(folder) for folder in folders]
    if len({one.name for one in flown}) < len(flown):  # runs of one scenario
        flown = [one._replace(name=folder.resolve().name) for one, folder in zip(flown, folders, strict=True)]
    path = out or (folders[0] / REPORT_FILE if len(folders) == 1 else Path("comparison.html"))
    write_file(path, report_html(flown))
    click.echo(str(path))
