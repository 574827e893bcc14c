# SPDX-License-Identifier: Apache-2.0
"""The tables of docs/compared.md, UTC beside a regulator and a nonlinear MPC on six textbook plants: ``make compared``.

Each controller is tuned by the same random search (random_search.py) on one reference of each plant and flown with
what was found on another one; at most five minutes on one core. All but the times are the same in every run on one
machine. ``--write`` puts the tables into the page.
"""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import click
import numpy as np
from random_search import random_search
from textbook_plants import PLANTS, TextbookPlant
from textbook_tasks import TASKS, Task, reference
from timing import machine

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.linear_quadratic import LinearQuadraticController
from skydiver_utc.controllers.protocol import Controller
from skydiver_utc.controllers.settings import GaussNewtonSettings, LqrSettings
from skydiver_utc.controllers.utc.settings import UtcSettings
from skydiver_utc.controllers.utc.unscented_transform_controller import UnscentedTransformController

Values = dict[str, float]

FLIGHTS, SEED, FACTOR = 16, 1, 30.0
# Of searches that show how much of a figure is the luck of the search; MPC would take an hour for them.
OTHER_SEEDS = (2, 3, 4, 5)
LOST = 10.0
_PREVIEW = 60
_PAGE = Path(__file__).parents[1] / "docs" / "compared.md"


class Subject(NamedTuple):
    """A controller: what is tuned, from which start, as shares of the task's span and the step, and how it is made."""

    name: str
    start: Values
    made: Callable[[TextbookPlant, Values, float], Controller]


def utc(plant: TextbookPlant, values: Values, span: float) -> Controller:
    """UTC with its defaults for all that is not tuned, but for the innovation that leaves no offset."""
    settings = UtcSettings(
        horizon_steps=steps_of(values),
        P_err=values["P_err"] * span**2,
        Qu_ratio=values["Qu_ratio"],
        innovation="control",
    )
    return UnscentedTransformController(settings, plant)


def regulator(plant: TextbookPlant, values: Values, span: float) -> Controller:
    """The package's linear-quadratic regulator with preview, about the equilibrium at the start."""
    settings = LqrSettings(horizon_steps=_PREVIEW, **costs(plant, values, span))
    return LinearQuadraticController(settings, plant, plant.output_names, plant.dt_s)


def predictive(plant: TextbookPlant, values: Values, span: float) -> Controller:
    """CasADi and IPOPT, an extra."""
    from tool_chains.textbook import PredictiveController

    N = steps_of(values)
    settings = GaussNewtonSettings(horizon_steps=N, blocks=N, **costs(plant, values, span))
    return PredictiveController(settings, plant)


def costs(plant: TextbookPlant, values: Values, span: float) -> dict[str, dict[str, float]]:
    """The costs of all controls, in the outputs' units squared."""
    return {
        name: dict.fromkeys(plant.control_names, values[name] * span**2) for name in ("cost", "change_cost")
    }


def steps_of(values: Values) -> int:
    """The horizon, from 1 to 25 steps."""
    return min(max(round(values["horizon"]), 1), 25)


_COSTS = {"cost": 1e-3, "change_cost": 1e-1}
SUBJECTS = {
    "utc": Subject("UTC", {"horizon": 10.0, "P_err": 1e-3, "Qu_ratio": 0.1}, utc),
    "lqr": Subject("LQR", _COSTS, regulator),
    "mpc": Subject("MPC", {"horizon": 12.0, **_COSTS}, predictive),
}
_LEAD = {"lead": 5.0}


class Flight(NamedTuple):
    """y and what it should be (K, l), controls (K, m), seconds of each decision (K,)."""

    y: Array
    wanted: Array
    controls: Array
    seconds: Array


def fly(name: str, subject: Subject, values: Values, task: Task, strength: float = 1.0) -> Flight:
    """One flight; strength: the share of each control's distance from its initial value that arrives."""
    plain, steps = TextbookPlant(name), task.steps
    plant = TextbookPlant(name, values.get("lead", 0.0) * plain.dt_s)
    controller = subject.made(plant, values, task.span)
    preview = reference(plant, task.moves, steps + _PREVIEW + 1)
    state, rest = plant.initial_state(), plant.initial_control()
    states, controls, seconds = np.empty((steps, len(state))), np.empty((steps, len(rest))), np.empty(steps)
    with np.errstate(all="ignore"):
        for k in range(steps):
            begin = time.process_time()
            control = controller.decide(state, preview[k : k + controller.preview_steps + 1]).control
            seconds[k] = time.process_time() - begin
            states[k], controls[k] = state, control
            state = plant.step(state, control, rest + strength * (control - rest))
            if not np.isfinite(state).all():
                states[k + 1 :], controls[k + 1 :], seconds[k + 1 :] = np.nan, control, np.nan
                break
        return Flight(plain.outputs(states), reference(plain, task.moves, steps), controls, seconds)


def objective(flight: Flight, span: float) -> float:
    """RMSE as a share of the span, LOST at most."""
    error = float(np.sqrt(np.mean((flight.y - flight.wanted) ** 2))) / span
    return min(error, LOST) if math.isfinite(error) else LOST


def tuned(name: str, subject: Subject, flights: int = FLIGHTS, seed: int = SEED) -> Values:
    """The values with the least objective on the reference for tuning."""
    start = subject.start | (_LEAD if PLANTS[name].order else {})
    task = TASKS[name].tuned_on

    def values(point: Array) -> Values:
        return {key: float(f"{value:.3g}") for key, value in zip(start, np.exp(point), strict=True)}

    def flown(point: Array) -> float:
        try:
            return objective(fly(name, subject, values(point), task), task.span)
        except np.linalg.LinAlgError:  # no solution of the Riccati equation
            return LOST

    tried = random_search(flown, np.log(list(start.values())), math.log(FACTOR), flights, seed)
    best, _ = min(tried, key=lambda pair: pair[1])
    return values(best)


class Row(NamedTuple):
    """A controller on a plant: errors in per cent of the span.

    settled: steps after the last move until the error stays within 2 %, None: never
    offset, weak_offset: mean error of the last ten steps; the latter with controls that arrive at nine tenths
    travel: mean change of a control from step to step, in per cent of its range
    others: RMSE after searches with OTHER_SEEDS
    """

    plant: str
    controller: str
    values: Values
    rmse: float
    settled: int | None
    offset: float
    weak_offset: float
    travel: float
    seconds: Array
    others: tuple[float, ...] = ()


def judged(name: str, subject: Subject, values: Values) -> Row:
    """The flight on the reference for judging."""
    task, plant = TASKS[name].judged_on, TextbookPlant(name)
    found, weak = (fly(name, subject, values, task, strength) for strength in (1.0, 0.9))
    error, weak_error = (np.abs(one.y - one.wanted).max(axis=1) / task.span for one in (found, weak))
    begin, length, _ = task.moves[-1]
    after = error[begin + length :]
    outside = np.flatnonzero(~(after <= 0.02))
    settled = int(outside[-1]) + 1 if len(outside) else 0
    change = np.abs(np.diff(found.controls, axis=0)) / (plant.maximum - plant.minimum)
    return Row(
        plant=plant.about.title,
        controller=subject.name,
        values=values,
        rmse=100.0 * objective(found, task.span),
        settled=None if settled == len(after) else settled,
        offset=100.0 * float(error[-10:].mean()),
        weak_offset=100.0 * float(weak_error[-10:].mean()),
        travel=100.0 * float(change.mean()),
        seconds=found.seconds[np.isfinite(found.seconds)],
    )


def compared(names: Sequence[str], subjects: Sequence[str], flights: int = FLIGHTS) -> Iterator[Row]:
    """A row for each controller on each plant."""
    for name in names:
        for key in subjects:
            subject = SUBJECTS[key]
            click.echo(f"{name}, {subject.name}", err=True)
            row = judged(name, subject, tuned(name, subject, flights))
            seeds = () if key == "mpc" else OTHER_SEEDS
            others = (judged(name, subject, tuned(name, subject, flights, seed)).rmse for seed in seeds)
            yield row._replace(others=tuple(others))


def percent(value: float) -> str:
    """Two digits; `lost` beyond the whole span."""
    if value < 1e-3:
        return "<0.001"
    return f"{value:.2g}" if value < 99.5 else "lost"


def tables(rows: Sequence[Row]) -> str:
    """The rows as two tables of Markdown."""
    lines = [
        "| plant | controller | RMSE | other searches | settled | steady offset | controls at 9/10 | travel"
        " | tuned to |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        settled = "never" if row.settled is None else str(row.settled)
        errors = (percent(value) for value in (row.rmse, row.offset, row.weak_offset, row.travel))
        rmse, offset, weak, travel = errors
        others = ", ".join(percent(value) for value in row.others)
        values = row.values | ({"horizon": steps_of(row.values)} if "horizon" in row.values else {})
        text = ", ".join(f"{name} {value:g}" for name, value in values.items())
        cells = (row.plant, row.controller, rmse, others, settled, offset, weak, travel, text)
        lines.append(f"| {' | '.join(cells)} |")
    names = [subject.name for subject in SUBJECTS.values()]
    lines += [
        "",
        f"| median time of a step | {' | '.join(f'{name} [us]' for name in names)} | LQR / UTC | MPC / UTC |",
    ]
    lines.append("|---|---|---|---|---|---|")
    for plant in dict.fromkeys(row.plant for row in rows):
        medians = [1e6 * float(np.median(row.seconds)) for row in rows if row.plant == plant]
        cells = [f"{median:.0f}" for median in medians] + [
            f"{float(f'{m / medians[0]:.2g}'):g}" for m in medians[1:]
        ]
        lines.append(f"| {plant} | {' | '.join(cells)} |")
    where = ", ".join(f"{name} {value}" for name, value in machine().items())
    return "\n".join([*lines, "", f"*{FLIGHTS} flights each, seed {SEED}; {where}.*"])


@click.command(help=__doc__)
@click.option("--write", is_flag=True, help="Put the tables into docs/compared.md instead of printing them.")
def main(write: bool) -> None:
    found = tables(list(compared(tuple(TASKS), tuple(SUBJECTS))))
    if not write:
        print(found)
        return
    head, begin, rest = _PAGE.read_text().partition("<!-- tables -->\n")
    _, end, tail = rest.partition("<!-- end of tables -->")
    _PAGE.write_text(f"{head}{begin}\n{found}\n\n{end}{tail}")


if __name__ == "__main__":
    main()
