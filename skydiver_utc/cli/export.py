# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc export``: a recorded run for other programs."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from skydiver_utc.cli import options
from skydiver_utc.cli.errors import CommandError
from skydiver_utc.cli.outputs import prepare_folder, save_figure


def _form(name: str, help_text: str) -> Any:
    return click.option(f"--{name}", "forms", flag_value=name, multiple=True, help=help_text)


@click.command(cls=options.Computing, short_help="Write a run as CSV, NPZ or Parquet, or its figure.")
@options.run_folder
@_form("csv", "Every step, one row each: run.csv.")
@_form("npz", "The same as NumPy arrays: run.npz.")
@_form("parquet", "The same as Parquet: run.parquet; needs the extra `studies`.")
@_form("png", "The figure: tracking.png.")
@_form("svg", "The figure as SVG.")
@_form("pdf", "The figure as PDF.")
@click.option(
    "--out", type=options.PATH, metavar="FOLDER",
    help="Write into this folder, made if missing, instead of into RUN.",
)  # fmt: skip
def export(folder: Path, forms: Sequence[str], out: Path | None) -> None:
    """Write the recorded run RUN for other programs; several forms at once, if wanted.

    Columns are time_s, and by their topic and name state/.., command/.., applied_command/.., reference/.., output/..,
    telemetry/.., disturbance/.., solve_time_s and status, in SI units and radians; NaN where a step has no value.
    """
    from skydiver_utc.analysis.recorded_run import read_run
    from skydiver_utc.analysis.table import FORMS, table
    from skydiver_utc.parameters.files import write_file

    if not forms:
        raise CommandError(
            "give at least one form, such as --csv or --svg: `skydiver-utc export --help` lists them"
        )
    run, place = read_run(folder), out or (folder if folder.is_dir() else folder.parent)
    prepare_folder(out)
    for form in dict.fromkeys(forms):
        path = place / f"{'run' if form in FORMS else 'tracking'}.{form}"
        if form in FORMS:
            try:
                write_file(path, table(run, form))
            except ModuleNotFoundError as error:
                sentence = f"--{form} needs {error.name}: pip install 'skydiver_utc[studies]'"
                raise CommandError(sentence) from error
        else:
            from skydiver_utc.analysis.figures import tracking_figure

            save_figure(path, tracking_figure(run))
        click.echo(str(path))
