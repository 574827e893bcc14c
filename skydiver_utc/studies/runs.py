"""Many flights at once: what is flown, in how many processes, and what is kept of each flight."""

import math
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import cache
from typing import NamedTuple, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.parameters import Scenario, load_scenario
from skydiver_utc.simulation.closed_loop import simulate
from skydiver_utc.simulation.flight import Flight
from skydiver_utc.simulation.skydiver_utc_controller import rescued_steps

Kept = TypeVar("Kept")
Done = Callable[[int], None]  # told how many flights are done

# Digits that a result is kept with: fewer than two machines agree on.
_DIGITS = 6


class Run(NamedTuple):
    """A scenario with overrides by dotted name; its text is what follows ``skydiver-utc simulate``."""

    scenario: str
    settings: tuple[tuple[str, object], ...] = ()

    @property
    def command(self) -> str:
        """The run as arguments of the command line."""
        return " ".join([self.scenario, *(f"--set {name}={_plain(value)}" for name, value in self.settings)])

    def load(self, duration_s: float | None = None) -> Scenario:
        """The resolved scenario; a duration replaces its own."""
        shortened = {} if duration_s is None else {"duration_s": duration_s}
        return load_scenario(self.scenario, dict(self.settings) | shortened)


@cache
def shipped(scenario: str) -> Scenario:
    """A scenario as it comes with the package, read once."""
    return load_scenario(scenario)


def run(scenario: str, *settings: tuple[str, object]) -> Run:
    """A run from its settings one by one."""
    return Run(scenario, settings)


class Measures(msgspec.Struct, frozen=True):
    """What is kept of a flight: its metrics but for the clocks, the same on every run of one machine.

    hands_correlation: of k_right and k_left as applied; -1 where they alternate, 1 where they press together.
    rescued_steps: where UTC's equations had no answer and the law of this package found one all the same.
    """

    outcome: str
    rmse_deg_s: float | None
    max_abs_error_deg_s: float | None
    convergence_time_s: float | None
    peak_yaw_rate_deg_s: float | None
    control_effort: float | None
    min_dorsal_axis: float | None
    angle_error_deg: float | None
    facing: str
    hands_correlation: float | None
    status_steps: dict[str, int]
    rescued_steps: int

    @property
    def rmse(self) -> float:
        """RMSE [deg/s] for comparisons: infinite for a flight that has none."""
        return math.inf if self.rmse_deg_s is None else self.rmse_deg_s

    @property
    def converged_at(self) -> float:
        """Convergence time [s] for comparisons: infinite for a flight that never converged."""
        return math.inf if self.convergence_time_s is None else self.convergence_time_s


def measure(flight: Flight) -> Measures:
    """Keep the metrics of a flight."""
    values = metrics(flight)
    rescued = rescued_steps(flight.telemetry_names, flight.telemetry)
    own = {"hands_correlation": _hands_correlation(flight), "rescued_steps": rescued}
    kept = {name: values[name] for name in Measures.__struct_fields__ if name not in own} | own
    return msgspec.convert({name: _rounded(value) for name, value in kept.items()}, Measures)


def whole(flight: Flight) -> Flight:
    """Keep the flight itself."""
    return flight


def fly_all(
    scenarios: Mapping[str, Scenario], keep: Callable[[Flight], Kept], jobs: int, done: Done
) -> dict[str, Kept]:
    """Fly scenarios by name in `jobs` processes; what `keep` (a module's function) leaves of each, in order."""
    kept: dict[str, Kept] = {}
    if jobs == 1:
        for count, (name, scenario) in enumerate(scenarios.items(), 1):
            kept[name] = _fly(scenario, keep)
            done(count)
        return kept
    # Spawned, because a fork would copy the thread that draws the progress bar in an unknown state.
    pool = ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), _follow_the_parent)
    try:
        names = {pool.submit(_fly, scenario, keep): name for name, scenario in scenarios.items()}
        for count, future in enumerate(as_completed(names), 1):
            kept[names[future]] = future.result()
            done(count)
    finally:
        pool.shutdown(cancel_futures=True)
    return {name: kept[name] for name in scenarios}


def _fly(scenario: Scenario, keep: Callable[[Flight], Kept]) -> Kept:
    return keep(simulate(scenario))


def _follow_the_parent() -> None:
    """Leave interrupts to the parent, and end with it, however it ends: an idle worker would wait for ever."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_the_parent, daemon=True).start()


def _end_with_the_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)


def _hands_correlation(flight: Flight) -> float | None:
    hands = flight.applied[:, 1:3]
    if len(hands) < 2 or np.any(np.std(hands, axis=0) == 0.0):
        return None
    correlations: NDArray[np.float64] = np.asarray(np.corrcoef(hands.T))
    return float(correlations[0, 1])


def _rounded(value: object) -> object:
    return float(f"{value:.{_DIGITS}g}") if isinstance(value, float) else value


def _plain(value: object) -> str:
    if isinstance(value, list):
        return f"[{','.join(map(_plain, value))}]"
    return str(value).lower() if isinstance(value, bool) else str(value)
