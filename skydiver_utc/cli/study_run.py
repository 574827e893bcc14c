# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc study run`` and ``show``: the runs of a study file, and one of them again."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import click

from skydiver_utc.cli.errors import CommandError
from skydiver_utc.cli.outputs import prepare_folder
from skydiver_utc.cli.screen import count_progress, show_lines
from skydiver_utc.cli.simulate import exit_code, fly
from skydiver_utc.parameters import to_yaml
from skydiver_utc.parameters.exit_codes import FAILED
from skydiver_utc.parameters.files import write_file
from skydiver_utc.studies.flights import Flown, Plan, StudyStoppedError, Tally, fly_study, kept_of
from skydiver_utc.studies.ledger import FAILED as FAILED_RUN
from skydiver_utc.studies.ledger import FILE, ledger
from skydiver_utc.studies.study import load_study
from skydiver_utc.studies.study_report import REPORT, write_report


def run_study(
    study: str, out: Path | None, workers: int, scheduler: str, until: float | None, quiet: bool
) -> int:
    """Fly what is missing, write and name the report; returns the exit code."""
    plan = Plan(load_study(study))
    plan.check()
    folder = _folder(plan, out)
    prepare_folder(folder)
    with ledger(folder, plan.study.name, plan.digest) as found, _progress(plan, quiet) as progress:
        try:
            rows = fly_study(plan, found, workers, progress, scheduler, until)
        except StudyStoppedError as error:
            count = len(found.rows())
            click.echo(
                f"Error: {error}: {count} runs stand in {folder / FILE}, the same command continues", err=True
            )
            return FAILED
    write_report(folder, plan, rows)
    failed = sum(row.outcome == FAILED_RUN for row in rows)
    show_lines(f"{len(rows)} runs, {failed} failed: {folder / REPORT}")
    return FAILED if failed else 0


def show_run(study: str, number: int, out: Path | None, record: bool, as_json: bool, quiet: bool) -> int:
    """Fly a run again, print its metrics, and compare them with the ledger's; returns the exit code."""
    plan = Plan(load_study(study))
    folder = _folder(plan, out)
    if not (folder / FILE).is_file():
        raise CommandError(f"there is no {folder / FILE}: run the study first, or give its folder with --out")
    with ledger(folder, plan.study.name, plan.digest) as found:
        row = next((row for row in found.rows() if row.number == number), None)
    if row is None:
        raise CommandError(f"{folder / FILE} has no run {number}: choose one that has ended")
    scenario, path = plan.scenario(number), folder / f"run_{number}.yaml"
    write_file(path, to_yaml(scenario))
    if row.trace:
        show_lines(f"run {number} failed: {row.sentence}", row.trace)
    if record:
        from skydiver_utc.cli.run import run

        return run([str(path)], (), None, False, 0, as_json, quiet)
    flown, _ = fly(scenario, f"{plan.study.name}, run {number}: {row.case}, {row.sample}", as_json, quiet)
    if kept_of(plan.study, Flown.of(flown)) != row.metrics:
        click.echo(
            f"Error: run {number} has other metrics in {folder / FILE}: another version flew it", err=True
        )
        return FAILED
    return exit_code(flown)


def _folder(plan: Plan, out: Path | None) -> Path:
    return out or Path("studies") / plan.study.name


@contextmanager
def _progress(plan: Plan, quiet: bool) -> Iterator[Callable[[Tally], None]]:
    """A bar with the number of runs, the shares of their outcomes, and the widest interval of a success."""
    total = sum(1 for _ in plan.design.numbers())
    with count_progress(plan.study.name, total, quiet) as bar:

        def show(tally: Tally) -> None:
            shares = ", ".join(
                f"{100.0 * n / tally.done:.0f} % {end}" for end, n in tally.outcomes.most_common()
            )
            bar(
                tally.done,
                f"{plan.study.name}: {shares}, interval {100.0 * tally.widest():.1f} %" if shares else None,
            )

        yield show
