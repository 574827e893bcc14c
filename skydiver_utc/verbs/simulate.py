"""``skydiver-utc simulate``: the flight in this process."""

from collections.abc import Sequence
from pathlib import Path

from skydiver_utc.analysis.metrics import FLOWN_TO_ITS_END, metrics, to_json
from skydiver_utc.simulation.closed_loop import simulate as fly
from skydiver_utc.simulation.flight import Flight
from skydiver_utc.verbs.errors import VerbError
from skydiver_utc.verbs.screen import flight_progress, show_metrics
from skydiver_utc.verbs.settings import load


def simulate(
    scenario_name: str, settings: Sequence[str], figure: Path | None, as_json: bool, quiet: bool
) -> int:
    """Fly, print the metrics, draw the figure; returns the exit code."""
    scenario = load(scenario_name, settings)
    if figure is not None:
        check_figure_path(figure)
    with flight_progress(scenario, quiet) as progress:
        flight = fly(scenario, progress)
    values = metrics(flight)
    if figure is not None:
        draw(flight, figure)
    if as_json:
        print(to_json(values))
    else:
        show_metrics(values, scenario.title)
    return exit_code(flight)


def exit_code(flight: Flight) -> int:
    """0 for a flight that was flown to its end."""
    return 0 if flight.outcome in FLOWN_TO_ITS_END else 1


def check_figure_path(path: Path) -> None:
    """Refuse, before the flight, a file that could not be written after it."""
    if path.suffix.lower() != ".png":
        raise VerbError(f"--figure {path} is no PNG file: let its name end in .png")
    if not path.parent.is_dir():
        raise VerbError(
            f"there is no folder {path.parent} for the figure {path.name}: make it, or choose another"
        )


def draw(flight: Flight, path: Path) -> None:
    """Write the figure of a flight; matplotlib is loaded only here."""
    from skydiver_utc.analysis.figures import tracking_figure
    from skydiver_utc.analysis.style import png

    path.write_bytes(png(tracking_figure(flight)))
