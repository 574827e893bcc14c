# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc calibrate``: a skydiver whose measures meet targets."""

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from skydiver_utc.cli import options
from skydiver_utc.cli.outputs import prepare_folder
from skydiver_utc.cli.screen import count_progress, show_lines, show_values
from skydiver_utc.errors import FAILED

if TYPE_CHECKING:
    from skydiver_utc.studies.calibration.evaluation import Evaluation

_EXIT_CODES = """\b
exit code
    0  every target is met
    1  some are not: the best skydiver was written
    2  the input is wrong: one sentence says why
  130  stopped with Ctrl-C: the same command continues
"""


@click.command(
    cls=options.Computing, epilog=_EXIT_CODES, short_help="Find a skydiver whose measures meet targets."
)
@click.argument("calibration", metavar="CALIBRATION")
@click.option(
    "--out", required=True, type=options.PATH, metavar="FOLDER",
    help="Write the skydiver here; a search that was interrupted here is continued.",
)  # fmt: skip
@options.seed
@click.option(
    "--evaluations", type=click.IntRange(1), help="How many skydivers to try, instead of the file's number."
)
@options.as_json
@options.quiet
def calibrate(
    calibration: str, out: Path, seed: int, evaluations: int | None, as_json: bool, quiet: bool
) -> int:
    """Find a skydiver whose fall, turns and flights meet targets, by changing numbers within bounds.

    CALIBRATION is a name below config/calibrations, or the path of a YAML file (docs/calibrate.md). FOLDER receives
    skydiver.yaml with its suit, subject, posture and pattern, calibration.json, and ledger.sqlite, from which the
    same command continues.
    """
    from skydiver_utc.parameters.files import write_file
    from skydiver_utc.studies.calibration.candidate import start_of
    from skydiver_utc.studies.calibration.files import report, write_skydiver
    from skydiver_utc.studies.calibration.search import best_of, search
    from skydiver_utc.studies.calibration.settings import load_calibration

    wanted = load_calibration(calibration)
    of_so_many = "" if evaluations is None else f" --evaluations {evaluations}"
    command = f"skydiver-utc calibrate {calibration} --seed {seed}{of_so_many}"
    start = start_of(wanted)
    prepare_folder(out)
    count = evaluations or wanted.evaluations
    with count_progress("start", count, quiet) as progress:

        def tried(done: "list[Evaluation]") -> None:
            best = best_of(done)
            progress(len(done), f"best: {sum(best.met)} of {len(best.met)} targets, cost {best.cost:.2f}")

        done = search(wanted, start, seed, count, out, tried)
    best = best_of(done)
    values = report(wanted, best, seed, len(done))
    write_file(out / "calibration.json", json.dumps(values, indent=2) + "\n")
    skydiver = None if best.error else write_skydiver(out, wanted, start, best, command)
    show_values(values, as_json)
    if skydiver and not as_json:
        show_lines(f"fly it: skydiver-utc simulate fast_turn_pi_dynamics --set plant.skydiver={skydiver}")
    return 0 if all(best.met) else FAILED
