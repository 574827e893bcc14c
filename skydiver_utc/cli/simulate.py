# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc simulate``: a run in this process."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from skydiver_utc.cli import options
from skydiver_utc.cli.outputs import check_figure_path, save_figure
from skydiver_utc.cli.screen import count_progress, show_metrics
from skydiver_utc.cli.settings import load
from skydiver_utc.errors import FAILED

if TYPE_CHECKING:
    from skydiver_utc.loop.run import Run
    from skydiver_utc.parameters import Scenario


@click.command(
    cls=options.Computing, epilog=options.EXIT_CODES, short_help="Run SCENARIO in this process, without ROS."
)
@options.scenario
@options.settings
@click.option(
    "--figure", type=options.PATH, metavar="FILE.png", help="Draw the run into this PNG, SVG or PDF file."
)
@options.as_json
@options.quiet
def simulate(scenario: str, settings: Sequence[str], figure: Path | None, as_json: bool, quiet: bool) -> int:
    """Run SCENARIO in this process, without ROS and without a recording."""
    loaded = load(scenario, settings)
    check_figure_path(figure)
    run, values = fly(loaded, loaded.title or loaded.name, as_json, quiet)
    if figure is not None:
        from skydiver_utc.analysis.figures import tracking_figure
        from skydiver_utc.analysis.validation_figure import validation_figure

        save_figure(figure, tracking_figure(run))
        if "estimation" in values:
            beside = figure.with_name(f"{figure.stem}_validation{figure.suffix}")
            save_figure(beside, validation_figure(run))
    return exit_code(run)


def fly(scenario: "Scenario", title: str, as_json: bool, quiet: bool) -> tuple["Run", dict[str, Any]]:
    """Run a scenario and print its metrics under a title, or as JSON."""
    from skydiver_utc.analysis.metrics import metrics, to_json
    from skydiver_utc.loop.closed_loop import simulate

    with count_progress(f"{scenario.name}, steps", scenario.steps, quiet) as progress:
        run = simulate(scenario, lambda step, _: progress(step))
    values = metrics(run)
    if as_json:
        print(to_json(values))
    else:
        show_metrics(values, title)
    return run, values


def exit_code(run: "Run") -> int:
    """0 for a run that reached its end."""
    from skydiver_utc.loop.outcome import REACHED_THE_END

    return 0 if run.outcome in REACHED_THE_END else FAILED
