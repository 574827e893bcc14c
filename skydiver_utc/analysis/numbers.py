# SPDX-License-Identifier: Apache-2.0
"""Rows and times of a run, and what several figures are computed with."""

import math

import numpy as np

from skydiver_utc.arrays import Array, Flags
from skydiver_utc.loop.outcome import Outcome
from skydiver_utc.loop.run import Run
from skydiver_utc.parameters import Scenario
from skydiver_utc.parameters.nanoseconds import NANOSECONDS, seconds

SETTLING_S = 2.0


def settled(run: Run) -> Flags:
    """The rows whose errors count: from 2 s on, none of a diverged run."""
    rows = recorded(run)
    rows[: len(rows) if run.outcome is Outcome.DIVERGED else row_from(SETTLING_S, run)] = False
    return rows


def recorded(run: Run) -> Flags:
    """The rows outside of the holes of a recording."""
    rows = np.ones(len(run.states), np.bool_)
    for begin, end in run.holes:
        rows[begin - run.first_step : end - run.first_step + 1] = False
    return rows


def row_from(time_s: float, run: Run) -> int:
    """The first row of a run at or after a time; the first of all where it begins later."""
    return max(0, first_step_from(time_s, run.scenario) - run.first_step)


def first_step_from(time_s: float, scenario: Scenario) -> int:
    """The first step at or after a time."""
    return math.ceil(round(time_s * NANOSECONDS) / scenario.dt_ns)


def time_of(run: Run, row: int) -> float:
    """Time [s] of a row."""
    return seconds((run.first_step + row) * run.scenario.dt_ns)


def root_mean_square(values: Array) -> float:
    """Root of the mean square, NaN of no values."""
    return math.sqrt(float(np.mean(np.square(values)))) if len(values) else math.nan


def largest(values: Array) -> float:
    """Largest absolute value, NaN of no values."""
    return float(np.max(np.abs(values))) if len(values) else math.nan


def finite(value: float) -> float | None:
    """The value, None for NaN and infinity."""
    return value if math.isfinite(value) else None
