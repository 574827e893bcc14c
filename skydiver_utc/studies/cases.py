# SPDX-License-Identifier: Apache-2.0
"""Many runs at once: which ones, in how many processes, and what is kept of each."""

import math
from collections.abc import Callable, Mapping
from concurrent.futures import as_completed
from functools import cache
from typing import NamedTuple, TypeVar

import numpy as np

from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.analysis.numbers import finite, largest, settled
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.loop.run import Run
from skydiver_utc.parameters import Parameters, Scenario, load_scenario
from skydiver_utc.studies.workers import executor

Kept = TypeVar("Kept")
Done = Callable[[int], None]  # called with the number of finished runs

# Digits that a result is kept with: fewer than two machines agree on.
_DIGITS = 6
# In UTC's telemetry `recovery`: only the covariances about the central point gave a result.
_ABOUT_CENTRE = 1.0


class Case(NamedTuple):
    """A scenario with overrides by dotted name."""

    scenario: str
    settings: tuple[tuple[str, object], ...] = ()

    @property
    def command(self) -> str:
        """The arguments of ``skydiver-utc simulate``."""
        return " ".join([self.scenario, *(f"--set {name}={_plain(value)}" for name, value in self.settings)])

    def load(self, duration_s: float | None = None) -> Scenario:
        """The resolved scenario; a duration replaces its own."""
        shortened = {} if duration_s is None else {"duration_s": duration_s}
        return load_scenario(self.scenario, dict(self.settings) | shortened)


def case(scenario: str, *settings: tuple[str, object]) -> Case:
    """A case from its settings one by one."""
    return Case(scenario, settings)


@cache
def shipped(scenario: str) -> Scenario:
    """A scenario as it comes with the package, read once."""
    return load_scenario(scenario)


class Measures(Parameters):
    """The metrics of a run without its clocks, the same on every run of one machine.

    hands_correlation: of k_right and k_left as applied; -1 where they alternate, 1 where they press together.
    largest_speed_m_s: airspeed, from 2 s on.
    rescued_steps: where the paper's equations had no solution and UTC continued with covariances about the centre.
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
    largest_speed_m_s: float | None
    status_steps: dict[str, int]
    rescued_steps: int

    @property
    def rmse(self) -> float:
        """RMSE [deg/s] for comparisons: infinite where it is undefined."""
        return math.inf if self.rmse_deg_s is None else self.rmse_deg_s

    @property
    def converged_at(self) -> float:
        """Convergence time [s] for comparisons: infinite without convergence."""
        return math.inf if self.convergence_time_s is None else self.convergence_time_s

    @property
    def effort(self) -> float:
        """Control effort for comparisons: infinite where it is undefined."""
        return math.inf if self.control_effort is None else self.control_effort


def measure(run: Run) -> Measures:
    """Keep the metrics of a skydiver's run."""
    recovery = run.telemetry[:, [name == "recovery" for name in run.telemetry_names]]
    found = metrics(run) | {
        "hands_correlation": _hands_correlation(run),
        "largest_speed_m_s": finite(largest(np.linalg.norm(run.states[settled(run), 7:10], axis=1))),
        "rescued_steps": int(np.count_nonzero(recovery == _ABOUT_CENTRE)),
    }
    kept = {name: found[name] for name in Measures.model_fields}
    return Measures.model_validate(
        {name: float(f"{x:.{_DIGITS}g}") if isinstance(x, float) else x for name, x in kept.items()}
    )


def run_all(
    scenarios: Mapping[str, Scenario], keep: Callable[[Run], Kept], workers: int, done: Done
) -> dict[str, Kept]:
    """Run scenarios by name in `workers` processes; what `keep` (a module's function) returns of each, in order."""
    kept: dict[str, Kept] = {}
    with executor(workers) as pool:
        names = {pool.submit(_run, scenario, keep): name for name, scenario in scenarios.items()}
        for count, future in enumerate(as_completed(names), 1):
            kept[names[future]] = future.result()
            done(count)
    return {name: kept[name] for name in scenarios}


def _run(scenario: Scenario, keep: Callable[[Run], Kept]) -> Kept:
    return keep(simulate(scenario))


def _hands_correlation(run: Run) -> float | None:
    hands = run.applied[:, 1:3]
    if len(hands) < 2 or np.any(np.std(hands, axis=0) == 0.0):
        return None
    return float(np.asarray(np.corrcoef(hands.T))[0, 1])


def _plain(value: object) -> str:
    if isinstance(value, list):
        return f"[{','.join(map(_plain, value))}]"
    if value is None:
        return "null"
    return str(value).lower() if isinstance(value, bool) else str(value)
