# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc analyse``: metrics, figure and report of a run, from its bag alone."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from skydiver_utc.cli import options
from skydiver_utc.cli.errors import CommandError
from skydiver_utc.cli.screen import show_metrics

if TYPE_CHECKING:
    from skydiver_utc.loop.run import Run
    from skydiver_utc.view.report import Flown


@click.command(cls=options.Computing, short_help="Analyse a run folder again, from its bag.")
@options.run_folder
@options.as_json
def analyse(folder: Path, as_json: bool) -> None:
    """Make metrics.json, the figures and report.html of the run folder RUN again, from its bag alone."""
    show(*examine(folder), as_json)


def show(run: "Run", values: dict[str, Any], as_json: bool) -> None:
    """Print the metrics of a recorded run."""
    from skydiver_utc.analysis.labels import reference_added
    from skydiver_utc.analysis.metrics import to_json

    if as_json:
        print(to_json(values))
        return
    show_metrics(values, run.scenario.title or run.scenario.name)
    if ignored := values["ignored_messages"]:
        counts = ", ".join(f"{count} on {name}" for name, count in ignored.items())
        click.echo(f"ignored messages, without a step of the run or unreadable: {counts}")
    if sentence := reference_added(values["reference_steps_not_recorded"]):
        click.echo(sentence)


def examine(folder: Path) -> tuple["Run", dict[str, Any]]:
    """Read the run and write its metrics, figure and report beside the bag; the run and its metrics."""
    from skydiver_utc.analysis.figures import tracking_figure
    from skydiver_utc.analysis.metrics import to_json
    from skydiver_utc.analysis.style import png
    from skydiver_utc.analysis.validation_figure import validation_figure
    from skydiver_utc.parameters.files import write_file
    from skydiver_utc.parameters.run_folder import FIGURE_FILE, METRICS_FILE, REPORT_FILE, VALIDATION_FILE
    from skydiver_utc.view.report import report_html

    flown = read(folder)
    files: dict[str, str | bytes] = {
        METRICS_FILE: to_json(flown.metrics) + "\n",
        FIGURE_FILE: png(tracking_figure(flown.run)),
        REPORT_FILE: report_html([flown]),
    }
    if "estimation" in flown.metrics:
        files[VALIDATION_FILE] = png(validation_figure(flown.run))
    for name, content in files.items():
        write_file(folder / name, content)
    return flown.run, flown.metrics


def read(folder: Path) -> "Flown":
    """The run of a folder, named as its scenario, with its metrics and versions.

    Metrics of a recording have three more: `run_id`; `ignored_messages`, by topic, without a step of the run or
    unreadable; `reference_steps_not_recorded`, which are those of the recorded scenario.
    """
    from skydiver_utc.analysis.metrics import metrics
    from skydiver_utc.analysis.recorded_run import RecordedRun
    from skydiver_utc.parameters.run_folder import VERSIONS_FILE
    from skydiver_utc.view.report import Flown

    if folder.is_file():
        raise CommandError(f"{folder} is a file: give the run folder that it lies in")
    recording = RecordedRun(folder)
    run = recording.run()
    values = {
        **metrics(run),
        "run_id": recording.run_id,
        "ignored_messages": dict(recording.ignored),
        "reference_steps_not_recorded": recording.reference_added,
    }
    return Flown(run.scenario.name, run, values, _versions(folder / VERSIONS_FILE))


def _versions(path: Path) -> dict[str, str]:
    """The recorder's file beside the bag, empty where it is missing."""
    from skydiver_utc.parameters.run_folder import text_of

    try:
        found = json.loads(text_of(path))
    except (ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}
