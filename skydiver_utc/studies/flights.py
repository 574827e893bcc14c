# SPDX-License-Identifier: Apache-2.0
"""The runs of a study: which are missing, flown by an executor, each written to the ledger as it ends."""

import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from functools import lru_cache
from itertools import islice
from typing import Any, NamedTuple

from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.loop.outcome import Outcome
from skydiver_utc.loop.run import Run
from skydiver_utc.parameters import ParameterError, Scenario, from_yaml, override, to_yaml
from skydiver_utc.studies.design import Design, Sample
from skydiver_utc.studies.intervals import share_interval
from skydiver_utc.studies.ledger import FAILED, Ledger, Row
from skydiver_utc.studies.study import Study

_CLOCKS = ("solve_time_us", "wall_time_s")


class StudyStoppedError(Exception):
    """Runs cannot go on: a worker or the scheduler ended."""


class Flown(NamedTuple):
    """The end of a run, its metrics by dotted name, one sentence, and its CPU time [s]."""

    outcome: str
    metrics: dict[str, Any]
    sentence: str
    cpu_s: float

    @classmethod
    def of(cls, run: Run, began: float = 0.0) -> "Flown":
        """The end of a run that began at this CPU time."""
        found = {name: value for name, value in flat(metrics(run)) if not name.startswith(_CLOCKS)}
        return cls(run.outcome.value, found, str(found["reason"]), time.thread_time() - began)


def kept_of(study: Study, flown: Flown) -> dict[str, Any]:
    """The metrics that a study keeps of a run."""
    return {name: flown.metrics.get(name) for name in study.metrics}


class Plan:
    """A study with the scenarios of its cases."""

    def __init__(self, study: Study) -> None:
        self.study, self.scenarios, self.design = study, study.load(), Design(study)
        self.digest = study.digest(self.scenarios)
        self.own = {name: scenario.as_dict() for name, scenario in self.scenarios.items()}
        self._texts = {name: to_yaml(scenario) for name, scenario in self.scenarios.items()}

    def check(self, pool: Executor) -> None:
        """Raise `ParameterError` for a setting, a value or a metric that a case does not have; flies one step each.

        Of a distribution both ends and the middle are tried, of a choice or a grid every value.
        """
        most = max(3, *(len(one.values) for one in self.study.vary.values()))
        middles: dict[str, Future[Flown]] = {}
        for name, scenario in self.scenarios.items():
            with self.study.naming(name):
                for i in range(most):
                    share = min(max(i / (most - 1), 1e-9), 1.0 - 1e-9)
                    values = {setting: one.at(share) for setting, one in self.study.vary.items()}
                    settings = self.design.settings(Sample(values, 0), self.own[name])
                    found = override(scenario, settings)
                    if i == most // 2:
                        middles[name] = self.submit(pool, name, settings | {"duration_s": found.dt_s})
        for name, future in middles.items():
            with self.study.naming(name):
                if error := _error(future):
                    raise error
            metrics = future.result().metrics
            if unknown := set(self.study.metrics) - set(metrics):
                raise ParameterError(
                    f"study {self.study.name}: a run of {name!r} has no metric {', '.join(sorted(unknown))}:"
                    f" choose from {', '.join(metrics)}"
                )
            if texts := [bar for bar in self.study.success if isinstance(metrics[bar], str)]:
                raise ParameterError(f"study {self.study.name}: success has {texts[0]}, which is no number")

    def settings(self, number: int) -> dict[str, Any]:
        """Overrides of a run on the scenario of its case."""
        return self.design.settings(self.design.sample(number), self.own[self.design.case(number)])

    def scenario(self, number: int) -> Scenario:
        """The scenario of a run."""
        return override(self.scenarios[self.design.case(number)], self.settings(number))

    def submit(self, pool: Executor, case: str, settings: Mapping[str, Any]) -> Future[Flown]:
        """The call of `fly`; one to a pool that lost a worker is lost, too."""
        try:
            return pool.submit(fly, self._texts[case], settings)
        except BrokenExecutor as error:
            lost: Future[Flown] = Future()
            lost.set_exception(error)
            return lost

    def row(self, number: int, ended: Flown | BaseException) -> Row:
        """The row of a run that ended, or raised an error."""
        trace = ""
        if isinstance(ended, BaseException):
            trace = "".join(traceback.format_exception(ended))
            ended = Flown(FAILED, {}, " ".join(str(ended).split()) or type(ended).__name__, 0.0)
        case, sample = self.design.case(number), self.design.sample(number).values
        kept = kept_of(self.study, ended) if ended.metrics else {}
        success = self.is_success(ended.outcome, kept)
        return Row(number, case, sample, ended.outcome, success, kept, ended.sentence, trace, ended.cpu_s)

    def is_success(self, outcome: str, kept: Mapping[str, Any]) -> bool:
        """Whether a run was completed with its metrics within the bars."""
        return outcome == Outcome.COMPLETED.value and all(
            bar.holds(kept.get(name)) for name, bar in self.study.success.items()
        )


def fly(scenario: str, settings: Mapping[str, Any]) -> Flown:
    """Fly a resolved scenario in YAML with overrides; nothing else decides the numbers."""
    began = time.thread_time()
    return Flown.of(simulate(override(_scenario(scenario), settings)), began)


_scenario = lru_cache(maxsize=64)(from_yaml)


def flat(content: Mapping[str, Any], prefix: str = "") -> Iterable[tuple[str, Any]]:
    """Values that are no blocks or lists, by their dotted names."""
    for name, value in content.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{prefix}{name}.")
        elif not isinstance(value, list):
            yield prefix + name, value


class Tally:
    """Counts of the runs 0, 1, ... without a gap, so that the same runs decide whatever the order they end in.

    until: the 95 % interval of every case's share of successes is this narrow; `enough` says so, after the run `last`
    """

    def __init__(self, numbers: Sequence[int], rows: Iterable[Row], until: float | None) -> None:
        self._numbers, self._next, self._until = numbers, 0, until
        self._ended: dict[int, Row] = {}
        self.done, self.enough, self.outcomes = 0, False, Counter[str]()
        self._flown, self._successes = Counter[str](), Counter[str]()
        self._widths: dict[str, float] = {}
        for row in rows:
            self.add(row)

    def add(self, row: Row) -> None:
        """Count a run."""
        self.done += 1
        self.outcomes["success" if row.success else row.outcome] += 1
        self._ended[row.number] = row
        while not self.enough and self._next < len(self._numbers):
            following = self._ended.pop(self._numbers[self._next], None)
            if following is None:
                return
            self._next += 1
            self._flown[following.case] += 1
            self._successes[following.case] += following.success
            low, high = share_interval(self._successes[following.case], self._flown[following.case])
            self._widths[following.case] = high - low
            self.enough = self._until is not None and self.widest() <= self._until

    def widest(self) -> float:
        """Widest interval of a case's share among the runs without a gap."""
        return max(self._widths.values(), default=1.0)

    @property
    def last(self) -> int:
        """Number of the last run without a gap before it."""
        return self._numbers[self._next - 1]


def fly_study(
    plan: Plan,
    ledger: Ledger,
    pool: Executor,
    at_once: int,
    progress: Callable[[Tally], None],
    until: float | None = None,
) -> list[Row]:
    """Fly the missing runs, so many at once; the rows of the study, by number, to the one that reached `until`.

    Raises `StudyStoppedError` when a worker or the scheduler ends; the ledger has every run that ended before.
    """
    numbers = list(plan.design.numbers())
    kept, wanted = ledger.rows(), set(numbers)
    tally = Tally(numbers, [row for row in kept if row.number in wanted], until)
    done = {row.number for row in kept}
    missing = iter(sorted(wanted - done))
    progress(tally)
    flying: dict[Future[Flown], int] = {}
    while not tally.enough:
        flying |= {
            plan.submit(pool, plan.design.case(n), plan.settings(n)): n
            for n in islice(missing, at_once - len(flying))
        }
        if not flying:
            break
        # Runs that ended come before those that were lost with a worker, which stop the study.
        for future in sorted(wait(flying, return_when=FIRST_COMPLETED).done, key=_is_lost):
            row = plan.row(flying.pop(future), _error(future) or future.result())
            ledger.add(row)
            tally.add(row)
        progress(tally)
    last = tally.last if tally.enough else numbers[-1]
    return [row for row in ledger.rows() if row.number in wanted and row.number <= last]


def _is_lost(future: "Future[Flown]") -> bool:
    return future.cancelled() or _is_of_a_worker(future.exception())


def _is_of_a_worker(error: BaseException | None) -> bool:
    """Whether a worker ended before its run did; Dask, whose error is the other one, need not be installed."""
    return isinstance(error, BrokenExecutor) or type(error).__name__ == "KilledWorker"


def _error(future: "Future[Flown]") -> BaseException | None:
    """The error of a run, when it has ended."""
    try:
        error = future.exception()
    except CancelledError as cancelled:
        raise StudyStoppedError("the scheduler ended, or lost the runs") from cancelled
    if _is_of_a_worker(error):
        raise StudyStoppedError("a worker process ended before its run did") from error
    return error
