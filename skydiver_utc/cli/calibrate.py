# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc calibrate``: a skydiver whose measures meet targets."""

from functools import partial
from pathlib import Path
from typing import Any

from rich.text import Text

from skydiver_utc.cli.outputs import prepare_folder
from skydiver_utc.cli.screen import count_progress, show_json_or, show_lines, show_tables, table
from skydiver_utc.parameters.exit_codes import FAILED
from skydiver_utc.studies.calibration.candidate import numbers_of, start_of
from skydiver_utc.studies.calibration.evaluation import Evaluation
from skydiver_utc.studies.calibration.files import report, write_report, write_skydiver
from skydiver_utc.studies.calibration.search import best_of, search
from skydiver_utc.studies.calibration.settings import Calibration, load_calibration


def calibrate(
    calibration: str, out: Path, seed: int, evaluations: int | None, as_json: bool, quiet: bool
) -> int:
    """Search, write the best skydiver into the folder, print it beside its targets; returns the exit code."""
    wanted = load_calibration(calibration)
    of_so_many = "" if evaluations is None else f" --evaluations {evaluations}"
    command = f"skydiver-utc calibrate {calibration} --seed {seed}{of_so_many}"
    start = start_of(wanted)
    prepare_folder(out)
    count = evaluations or wanted.evaluations
    with count_progress("start", count, quiet) as progress:

        def tried(done: list[Evaluation]) -> None:
            best = best_of(done)
            progress(len(done), f"best: {sum(best.met)} of {len(best.met)} targets, cost {best.cost:.2f}")

        done = search(wanted, start, seed, count, out, tried)
    best = best_of(done)
    values = report(wanted, best, seed, len(done))
    write_report(out, values)
    skydiver = None if best.error else write_skydiver(out, wanted, start, best, command)
    show_json_or(values, as_json, partial(_show, wanted, numbers_of(wanted, start)))
    if skydiver and not as_json:
        show_lines(f"fly it: skydiver-utc simulate fast_turn_pi_dynamics --set plant.skydiver={skydiver}")
    return 0 if all(best.met) else FAILED


def _show(calibration: Calibration, before: dict[str, float], values: dict[str, Any]) -> None:
    title = f"{values['calibration']}, the best of {values['evaluations']}"
    targets = table(title, "stage", "measure", "wanted", ">found", "", show_edge=False)
    for row in values["targets"]:
        bars = [
            f"{side.replace('_', ' ')} {row[side]:g}" + (f" x {row['times']}" if row.get("times") else "")
            for side in ("at_least", "at_most")
            if row[side] is not None
        ]
        found = "none" if row["found"] is None else f"{row['found']:.4g}"
        verdict = Text("met", style="green") if row["met"] else Text("not met", style="red")
        targets.add_row(Text(row["stage"]), Text(row["measure"]), Text(", ".join(bars)), found, verdict)
    numbers = table("Numbers", "", ">start", ">found", ">smallest", ">largest", show_edge=False)
    for name, bounds in calibration.numbers.items():
        numbers.add_row(name, *(f"{value:g}" for value in (before[name], values["numbers"][name], *bounds)))
    show_tables(targets, numbers)
    show_lines(*filter(None, [values["error"]]))
