# SPDX-License-Identifier: Apache-2.0
"""The search for a skydiver that meets the targets, and its ledger, from which it continues after an interruption.

The optimiser (CMA-ES) is not saved: with the same seed it asks for the same skydivers again, and those in the ledger
have their answer already. So a continued search is the uninterrupted one to the last bit.
"""

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from skydiver_utc.arrays import Array
from skydiver_utc.parameters import ParameterError, Scenario
from skydiver_utc.studies.calibration.candidate import numbers_of
from skydiver_utc.studies.calibration.evaluation import Evaluation, evaluate
from skydiver_utc.studies.calibration.settings import Calibration
from skydiver_utc.studies.ledger import FILE, Row, ledger

# First standard deviation, as a share of the distance of the bounds.
_FIRST_STEP = 0.15
# Of a number that is tried, as it is written into the files.
_DIGITS = 5


def search(
    calibration: Calibration,
    start: Scenario,
    seed: int,
    evaluations: int,
    folder: Path,
    tried: Callable[[list[Evaluation]], None],
) -> list[Evaluation]:
    """Try skydivers until all targets are met or so many have been tried; the ledger in the folder is continued.

    `tried(evaluations so far)` is called after each. Raises `ParameterError` for the ledger of another search.
    """
    whole = json.dumps({"calibration": calibration.as_dict(), "seed": seed}, sort_keys=True)
    done: list[Evaluation] = []
    asked = _asked(calibration, start, seed, done)
    with ledger(folder, calibration.name, whole) as kept:
        other = ParameterError(f"{folder / FILE} is of another version of this package: move it away")
        try:
            known = [Evaluation.model_validate(row.metrics) for row in kept.rows()]
        except ValidationError as error:
            raise other from error
        while len(done) < evaluations and not (done and all(done[-1].met)):
            numbers = next(asked)
            if len(done) < len(known):
                one = known[len(done)]
                if one.numbers != numbers:
                    raise other
            else:
                one = evaluate(calibration, start, numbers)
                kept.add(
                    Row(len(done), "", numbers, "tried", all(one.met), one.as_dict(), one.error, "", 0.0)
                )
            done.append(one)
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
