# SPDX-License-Identifier: Apache-2.0
"""The measured side of the comparison with the paper, as it is kept in ``results.json``."""

import time
from collections.abc import Mapping

import numpy as np

from skydiver_utc.analysis.numbers import finite
from skydiver_utc.loop.build import build_controller, build_plant, build_reference
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.parameters import Parameters, Scenario
from skydiver_utc.rotations import world_up
from skydiver_utc.studies.cases import Case, Done, Measures, case, measure, run_all
from skydiver_utc.studies.flights import Plan
from skydiver_utc.studies.paper_cases import M0_C2, all_cases
from skydiver_utc.studies.sensitivity import Calibration, sensitivity, sensitivity_flights
from skydiver_utc.studies.study import load_study

QUICK_S = 5.0
TUNINGS = "tuning"  # the study of random tunings
_PUSHED_S = 1.0
_TIMED_S, _IN_A_ROW = 2.0, 20


class HandPush(Parameters):
    """Bank to the right [deg] and yaw rate to the left [deg/s] after the left hand was pressed fully for 1 s."""

    bank_right_deg: float
    yaw_rate_deg_s: float


class StepCost(Parameters):
    """Processor time of one Gauss-Newton iteration as a multiple of UTC's decision, both 20 steps ahead.

    held: for one control over the horizon, which is what UTC finds; every_step: for a control of each step.
    """

    held: float
    every_step: float


class Tunings(Parameters):
    """Random tunings: how many, how many converge in the first half of the flight, median RMSE [deg/s]."""

    count: int
    converged: int
    rmse: float | None


class PaperResults(Parameters):
    """Measures of every run by its command, random tunings by scenario, and the plants with other numbers.

    `cost` alone comes from a clock, and differs from run to run.
    """

    schema_version: int
    quick: bool
    measures: dict[str, Measures]
    push: HandPush
    cost: StepCost
    tuning: dict[str, Tunings]
    sensitivity: tuple[Calibration, ...]

    def of(self, one: Case) -> Measures:
        """Measures of a case."""
        return self.measures[one.command]


def flights(quick: bool) -> dict[str, Scenario]:
    """Every run of the comparison: cases by their command, tunings by their number, calibrations by their name.

    A quick comparison has only the first `QUICK_S` of each, and few tunings and calibrations: it shows that everything
    works, not how well.
    """
    duration_s = QUICK_S if quick else None
    cases = {command: one.load(duration_s) for command, one in all_cases().items()}
    plan = Plan(load_study(TUNINGS))
    numbers = list(plan.design.numbers())[: len(plan.scenarios) if quick else None]
    changed = {"duration_s": duration_s} if quick else {}
    more = {f"{TUNINGS}/{n}": plan.scenario(n) for n in numbers} | sensitivity_flights(1 if quick else None)
    return cases | {name: one.replace(**changed) for name, one in more.items()}


def run_comparison(wanted: Mapping[str, Scenario], quick: bool, workers: int, done: Done) -> PaperResults:
    """Run `flights`, and measure the rest."""
    found = run_all(wanted, measure, workers, done)
    return PaperResults(
        schema_version=3,
        quick=quick,
        measures={command: found[command] for command in all_cases()},
        push=hand_push(M0_C2),
        cost=step_cost(),
        tuning=tunings(found),
        sensitivity=sensitivity(found),
    )


def tunings(found: Mapping[str, Measures]) -> dict[str, Tunings]:
    """The counts of random tunings by scenario."""
    plan = Plan(load_study(TUNINGS))
    by_case: dict[str, list[Measures]] = {name: [] for name in plan.scenarios}
    for name, one in found.items():
        group, _, number = name.partition("/")
        if group == TUNINGS:
            by_case[plan.design.case(int(number))].append(one)
    return {
        case: Tunings(
            count=len(flown),
            converged=sum(plan.is_success(one.outcome, one.as_dict()) for one in flown),
            rmse=finite(float(np.quantile([one.rmse for one in flown], 0.5, method="inverted_cdf"))),
        )
        for case, flown in by_case.items()
    }


def hand_push(one: Case) -> HandPush:
    """Press the left hand of the case's skydiver in a straight fall, without a controller."""
    scenario = one.load()
    plant = build_plant(scenario)
    state, held = plant.initial_state(), plant.initial_applied()
    pressed = plant.initial_control()
    pressed[2] = plant.maximum[2]
    for _ in range(round(_PUSHED_S / scenario.dt_s)):
        state, held = plant.advance(state, held, pressed)
    return HandPush(
        bank_right_deg=round(float(np.rad2deg(np.arcsin(world_up(state)[1]))), 3),
        yaw_rate_deg_s=round(float(np.rad2deg(state[12])), 3),
    )


def step_cost() -> StepCost:
    """Median times at the states of UTC's own run, some decisions of each controller in turn."""
    run = simulate(M0_C2.load(_TIMED_S))
    reference = build_reference(run.scenario)
    cases = [
        M0_C2,
        case("fast_turn_gauss_newton_held"),
        case("fast_turn_gauss_newton", ("controller.blocks", 20)),
    ]
    controllers = [build_controller(one.load(), run.plant, reference) for one in cases]
    taken: list[list[float]] = [[] for _ in controllers]
    for begin in range(0, len(run.commands) - _IN_A_ROW, _IN_A_ROW):
        for times, controller in zip(taken, controllers, strict=True):
            for k in range(begin, begin + _IN_A_ROW):
                preview = reference.preview(k, controller.preview_steps + 1)
                start = time.process_time()
                controller.decide(run.states[k], preview)
                times.append(time.process_time() - start)
    # The first turn compiles.
    utc, held, every_step = (float(np.median(times[_IN_A_ROW:])) for times in taken)
    return StepCost(held=float(f"{held / utc:.2g}"), every_step=float(f"{every_step / utc:.2g}"))
