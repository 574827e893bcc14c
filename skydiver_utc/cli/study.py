# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc study``: the runs of a study file, and one of them again."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from skydiver_utc.cli import options
from skydiver_utc.cli.errors import CommandError
from skydiver_utc.cli.outputs import prepare_folder
from skydiver_utc.cli.screen import count_progress, show_lines
from skydiver_utc.cli.simulate import exit_code, fly
from skydiver_utc.errors import FAILED

if TYPE_CHECKING:
    from skydiver_utc.studies.flights import Plan, Tally

_EXIT_CODES = """\b
exit code
    0  every run ended, whatever its outcome
    1  some runs failed, or a worker or the scheduler ended: the same command continues
    2  the input is wrong: one sentence says why, nothing was started
  130  stopped with Ctrl-C: the same command continues
"""
_out = click.option(
    "--out", type=options.PATH, metavar="FOLDER", help="The study's folder, instead of studies/ and its name."
)


@click.group()
def study() -> None:
    """Answer one question with many runs."""


@study.command(
    "run", cls=options.Computing, epilog=_EXIT_CODES, short_help="Fly the runs of STUDY that are missing."
)
@click.argument("name", metavar="STUDY")
@_out
@options.workers
@click.option("--scheduler", metavar="ADDRESS", default="", help="Fly on this Dask cluster instead.")
@click.option(
    "--until", type=click.FloatRange(0.0, 1.0, min_open=True), metavar="WIDTH",
    help="Stop when the 95 % interval of each case's share of successes is this narrow.",
)  # fmt: skip
@options.quiet
def run_study(
    name: str, out: Path | None, workers: int, scheduler: str, until: float | None, quiet: bool
) -> int:
    """Fly the runs of STUDY that its folder does not hold yet, and write the report.

    STUDY is a name below config/studies, or the path of a YAML file. FOLDER receives ledger.sqlite, in which every run
    stands as soon as it has ended, report.md with its figure, and runs.csv. The same command
    continues a study that was interrupted.
    """
    from skydiver_utc.studies.flights import Plan, StudyStoppedError, fly_study
    from skydiver_utc.studies.ledger import FAILED as FAILED_RUN
    from skydiver_utc.studies.ledger import FILE, ledger
    from skydiver_utc.studies.study import load_study
    from skydiver_utc.studies.study_report import REPORT, write_report
    from skydiver_utc.studies.workers import AT_ONCE_ON_CLUSTER, executor

    plan = Plan(load_study(name))
    folder, total = _folder(plan, out), sum(1 for _ in plan.design.numbers())
    with executor(workers, scheduler) as pool:
        plan.check(pool)
        prepare_folder(folder)
        with (
            ledger(folder, plan.study.name, plan.digest) as found,
            count_progress(plan.study.name, total, quiet) as bar,
        ):

            def show(tally: "Tally") -> None:
                shares = ", ".join(
                    f"{100.0 * n / tally.done:.0f} % {end}" for end, n in tally.outcomes.most_common()
                )
                interval = f"interval {100.0 * tally.widest():.1f} %"
                bar(tally.done, f"{plan.study.name}: {shares}, {interval}" if shares else None)

            at_once = AT_ONCE_ON_CLUSTER if scheduler else 2 * workers
            try:
                rows = fly_study(plan, found, pool, at_once, show, until)
            except StudyStoppedError as error:
                kept = f"{len(found.rows())} runs stand in {folder / FILE}, the same command continues"
                raise CommandError(f"{error}: {kept}", FAILED) from error
    write_report(folder, plan, rows)
    failed = sum(row.outcome == FAILED_RUN for row in rows)
    show_lines(f"{len(rows)} runs, {failed} failed: {folder / REPORT}")
    return FAILED if failed else 0


@study.command(
    "show", cls=options.Computing, epilog=options.EXIT_CODES, short_help="Fly one run of a study again."
)
@click.argument("name", metavar="STUDY")
@click.argument("number", metavar="RUN", type=click.IntRange(0))
@_out
@click.option("--record", is_flag=True, help="Fly it over ROS 2 and record it, as `skydiver-utc run` does.")
@options.as_json
@options.quiet
def show_run(name: str, number: int, out: Path | None, record: bool, as_json: bool, quiet: bool) -> int:
    """Fly one RUN of STUDY, by its number, again: the same numbers as in the ledger, bit for bit.

    FOLDER receives the resolved scenario as run_RUN.yaml.
    """
    from skydiver_utc.parameters import to_yaml
    from skydiver_utc.parameters.files import write_file
    from skydiver_utc.studies.flights import Flown, Plan, kept_of
    from skydiver_utc.studies.ledger import FAILED as FAILED_RUN
    from skydiver_utc.studies.ledger import FILE, ledger
    from skydiver_utc.studies.study import load_study

    plan = Plan(load_study(name))
    folder = _folder(plan, out)
    if not (folder / FILE).is_file():
        raise CommandError(f"there is no {folder / FILE}: run the study first, or give its folder with --out")
    with ledger(folder, plan.study.name, plan.digest) as found:
        row = next((row for row in found.rows() if row.number == number), None)
    if row is None:
        raise CommandError(f"{folder / FILE} has no run {number}: choose one that has ended")
    scenario, path = plan.scenario(number), folder / f"run_{number}.yaml"
    write_file(path, to_yaml(scenario))
    if row.outcome == FAILED_RUN:
        raise CommandError(f"run {number} failed: {row.sentence}; {folder / FILE} has the trace", FAILED)
    if record:
        from skydiver_utc.cli.run import run

        place = folder / f"run_{number}"
        code: int = click.get_current_context().invoke(
            run, scenarios=[str(path)], folder=place, as_json=as_json, quiet=quiet
        )
        click.echo(f"`skydiver-utc view {place}` shows it", err=True)
        return code
    flown, _ = fly(scenario, f"{plan.study.name}, run {number}: {row.case}, {row.sample}", as_json, quiet)
    if kept_of(plan.study, Flown.of(flown)) != row.metrics:
        raise CommandError(
            f"run {number} has other metrics in {folder / FILE}: another version flew it", FAILED
        )
    return exit_code(flown)


def _folder(plan: "Plan", out: Path | None) -> Path:
    return out or Path("studies") / plan.study.name
