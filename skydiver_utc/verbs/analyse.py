"""``skydiver-utc analyse``: metrics, figure and report of a run, from its bag alone."""

import json
from pathlib import Path
from typing import Any

import click

from skydiver_utc.analysis.figures import tracking_figure
from skydiver_utc.analysis.labels import reference_added
from skydiver_utc.analysis.metrics import metrics, to_json
from skydiver_utc.analysis.recorded_flight import RecordedFlight
from skydiver_utc.analysis.report import report_html
from skydiver_utc.analysis.style import png
from skydiver_utc.simulation.flight import Flight
from skydiver_utc.verbs.errors import VerbError
from skydiver_utc.verbs.screen import show_metrics


def analyse(folder: Path, as_json: bool) -> Flight:
    """Read the run, write its metrics, figure and report beside the bag, print the metrics."""
    flight, values = examine(folder)
    if as_json:
        print(to_json(values))
    else:
        show_metrics(values, flight.scenario.title)
        if ignored := values["ignored_messages"]:
            told = ", ".join(f"{count} on {name}" for name, count in ignored.items())
            click.echo(f"ignored messages that belong to no step or cannot be understood: {told}")
        if sentence := reference_added(values["reference_steps_not_recorded"]):
            click.echo(sentence)
    return flight


def examine(folder: Path) -> tuple[Flight, dict[str, Any]]:
    """Read the run and write its metrics, figure and report beside the bag; the flight and its metrics.

    `ignored_messages` of the metrics tells, by topic, how many messages belong to no step or cannot be understood,
    `reference_steps_not_recorded` how many steps of the reference are those of the recorded scenario.
    """
    if folder.is_file():
        raise VerbError(f"{folder} is a file: give the run folder that it lies in")
    recording = RecordedFlight(folder)
    flight = recording.flight()
    of_recording = {
        "ignored_messages": dict(recording.ignored),
        "reference_steps_not_recorded": recording.reference_added,
    }
    values = {**metrics(flight), **of_recording}
    figure = png(tracking_figure(flight))
    report = report_html(flight, values, figure, _versions(folder / "versions.json"))
    (folder / "metrics.json").write_text(to_json(values) + "\n", encoding="utf-8")
    (folder / "tracking.png").write_bytes(figure)
    (folder / "report.html").write_text(report, encoding="utf-8")
    return flight, values


def _versions(path: Path) -> dict[str, str]:
    """What the recorder wrote beside the bag; a folder copied without it has an empty list of versions."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}
