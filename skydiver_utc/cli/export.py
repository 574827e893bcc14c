# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc export``: a recorded run for other programs."""

from collections.abc import Sequence
from pathlib import Path

import click

from skydiver_utc.analysis.recorded_run import read_run
from skydiver_utc.analysis.table import FORMS, table
from skydiver_utc.cli.errors import CommandError
from skydiver_utc.cli.outputs import prepare_folder
from skydiver_utc.parameters.files import write_file


def export(folder: Path, forms: Sequence[str], out: Path | None) -> None:
    """Write the run in each form, print the files' names."""
    if not forms:
        raise CommandError(
            "give at least one form, such as --csv or --svg: `skydiver-utc export --help` lists them"
        )
    run, place = read_run(folder), out or (folder if folder.is_dir() else folder.parent)
    prepare_folder(out)
    for form in dict.fromkeys(forms):
        path = place / f"{'run' if form in FORMS else 'tracking'}.{form}"
        try:
            content = table(run, form) if form in FORMS else None
        except ModuleNotFoundError as error:
            raise CommandError(f"--{form} needs {error.name}: pip install 'skydiver_utc[studies]'") from error
        if content is None:
            # matplotlib is imported only for a figure.
            from skydiver_utc.analysis.figures import tracking_figure
            from skydiver_utc.analysis.style import picture

            content = picture(tracking_figure(run), form)
        write_file(path, content)
        click.echo(str(path))
