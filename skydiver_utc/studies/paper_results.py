"""The measured side of the comparison with the paper, as it is kept in ``results.json``."""

import msgspec

from skydiver_utc.simulation.flight import Flight
from skydiver_utc.studies.hand_push import HandPush, hand_push
from skydiver_utc.studies.paper_runs import FIGURES, M0_C2, PRINTED_HANDS, all_runs
from skydiver_utc.studies.runs import Done, Measures, Run, fly_all, measure, run, whole
from skydiver_utc.studies.step_cost import StepCost, step_cost
from skydiver_utc.studies.tuning_summary import TuningSummary

QUICK_S = 5.0


class PaperResults(msgspec.Struct, frozen=True, omit_defaults=True):
    """Measures of every flight by its command; `tuning` is kept in a file of its own.

    `cost` alone comes from a clock, and differs from run to run.
    """

    schema_version: int
    quick: bool
    measures: dict[str, Measures]
    push: HandPush
    push_printed: HandPush
    cost: StepCost | None = None
    tuning: list[TuningSummary] = []

    def of(self, one: Run) -> Measures:
        """Measures of a run."""
        return self.measures[one.command]


def fly_comparison(quick: bool, jobs: int, done: Done) -> tuple[PaperResults, dict[str, Flight]]:
    """Fly everything; also the flights of the paper's figures, whole, by the figures' names.

    A quick comparison flies only the first `QUICK_S` of each flight: it shows that everything works, not how well.
    """
    duration_s = QUICK_S if quick else None
    drawn = {label: one.load(duration_s) for label, one in FIGURES.items()}
    flights = fly_all(drawn, whole, jobs, done)
    shown = {one.command: label for label, one in FIGURES.items()}
    others = {command: one.load(duration_s) for command, one in all_runs().items() if command not in shown}
    found = fly_all(others, measure, jobs, lambda count: done(count + len(flights)))
    found |= {command: measure(flights[label]) for command, label in shown.items()}
    results = PaperResults(
        schema_version=1,
        quick=quick,
        measures={command: found[command] for command in all_runs()},
        push=hand_push(M0_C2),
        push_printed=hand_push(run(M0_C2.scenario, PRINTED_HANDS)),
        cost=step_cost(),
    )
    return results, flights
