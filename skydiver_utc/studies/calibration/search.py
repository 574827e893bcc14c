# SPDX-License-Identifier: Apache-2.0
"""The search for a skydiver that meets the targets, and its log, from which it continues after an interruption.

The optimiser (CMA-ES) is not saved: with the same seed it asks for the same skydivers again, and those in the log have
their answer already. So a continued search is the uninterrupted one to the last bit.
"""

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from skydiver_utc.parameters import ParameterError, Scenario
from skydiver_utc.parameters.files import write_file
from skydiver_utc.studies.calibration.candidate import numbers_of
from skydiver_utc.studies.calibration.evaluation import Evaluation, evaluate
from skydiver_utc.studies.calibration.settings import Calibration

Array = NDArray[np.float64]
Tried = Callable[[list[Evaluation]], None]

LOG = "evaluations.jsonl"
# First standard deviation, as a share of the distance of the bounds.
_FIRST_STEP = 0.15
# Of a number that is tried, as it is written into the files.
_DIGITS = 5


def search(
    calibration: Calibration, start: Scenario, seed: int, evaluations: int, folder: Path, tried: Tried
) -> list[Evaluation]:
    """Try skydivers until all targets are met or so many have been tried; the log in the folder is continued.

    `tried(evaluations so far)` is called after each. Raises `ParameterError` for the log of another search.
    """
    log = _Log(folder / LOG, {"calibration": calibration.as_dict(), "seed": seed})
    done: list[Evaluation] = []
    asked = _asked(calibration, start, seed, done)
    while len(done) < evaluations and not (done and all(done[-1].met)):
        numbers = next(asked)
        evaluation = log.answer(len(done), numbers)
        if evaluation is None:
            evaluation = evaluate(calibration, start, numbers)
            log.append(evaluation)
        done.append(evaluation)
        tried(done)
    return done


def best_of(done: list[Evaluation]) -> Evaluation:
    """The one that meets all targets, or costs least; the first of several."""
    return min(done, key=lambda one: (not all(one.met), one.cost))


def _asked(
    calibration: Calibration, start: Scenario, seed: int, done: list[Evaluation]
) -> Iterator[dict[str, float]]:
    """Numbers to try: those of the start, then what the optimiser asks for; `done` has the answers so far."""
    from cmaes import CMA

    own = numbers_of(calibration, start)
    yield own
    lower, upper = np.array(list(calibration.numbers.values())).T
    share = (np.array(list(own.values())) - lower) / (upper - lower)
    optimiser = CMA(share, _FIRST_STEP, np.tile([0.0, 1.0], (len(share), 1)), seed=seed)
    while True:
        population: list[tuple[Array, float]] = []
        for _ in range(optimiser.population_size):
            asked = optimiser.ask()
            values = lower + asked * (upper - lower)
            rounded = np.clip([float(f"{value:.{_DIGITS}g}") for value in values], lower, upper)
            yield dict(zip(calibration.numbers, rounded.tolist(), strict=True))
            population.append((asked, done[-1].cost))
        optimiser.tell(population)


class _Log:
    """Evaluations, one a line, after a line that says of which search."""

    def __init__(self, path: Path, search: dict[str, object]) -> None:
        self._path, head = path, json.dumps(search)
        # What is no whole line was cut short by the interruption.
        lines = path.read_text("utf-8").splitlines(keepends=True) if path.is_file() else []
        lines = [line for line in lines if line.endswith("\n")] or [head + "\n"]
        if lines[0] != head + "\n":
            raise ParameterError(
                f"{path} is of another calibration or seed: choose another folder, or move this one away"
            )
        self._lines = lines[1:]
        write_file(path, "".join(lines))

    def answer(self, number: int, numbers: dict[str, float]) -> Evaluation | None:
        """The evaluation of these numbers where the log has it."""
        if number >= len(self._lines):
            return None
        try:
            found = Evaluation.model_validate_json(self._lines[number])
        except ValidationError as error:
            raise ParameterError(f"{self._path} is damaged in line {number + 2}: move it away") from error
        if found.numbers != numbers:
            raise ParameterError(f"{self._path} is of another version of this package: move it away")
        return found

    def append(self, evaluation: Evaluation) -> None:
        """Write one more line."""
        with self._path.open("a", encoding="utf-8") as file:
            file.write(evaluation.model_dump_json() + "\n")
