# SPDX-License-Identifier: Apache-2.0
"""The result of a run, as arrays."""

import operator
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.protocol import DIVERGED_POINTS, Status
from skydiver_utc.loop.outcome import Outcome
from skydiver_utc.parameters import Scenario
from skydiver_utc.plants.protocol import Plant

_DELAY = "delay_steps"
# The arrays with a row for each state, and for each step.
_OF_STATES = ("states", "reference", "disturbance")
_OF_STEPS = ("commands", "applied", "telemetry", "solve_time_s", "status")


class ParameterChange(NamedTuple):
    """From a step on a node works with these parameters, all that differ from those of its start, by dotted name.

    A controller began there from `control` (m,); None: as at the start of a run. Its `delay_steps` is a parameter of
    the node and not of the scenario.
    """

    node: str
    step: int
    parameters: Mapping[str, Any]
    control: tuple[float, ...] | None

    @property
    def of_scenario(self) -> dict[str, Any]:
        """The parameters that are the scenario's."""
        return {name: value for name, value in self.parameters.items() if name != _DELAY}

    @property
    def delay_steps(self) -> int:
        """By how many steps the controller predicted the state ahead; TypeError if that is no integer."""
        return operator.index(self.parameters.get(_DELAY, 0))


@dataclass(frozen=True, eq=False)
class Run:
    """One closed-loop run of K steps; row i belongs to step k = first_step + i, time k dt.

    first_step is 0 but for a recording that lacks the beginning. holes: first and last step of each stretch that a
    recording lacks within; what is missing there is NaN.

    states (K+1, n); commands (K, m) decided by the controller; applied (K, m) after the plant's own limits
    reference (K+1, l) of the outputs (or controls) `tracked_names`
    telemetry (K, t) by `telemetry_names`; of each controller call solve_time_s (K,) and status (K,), the number of
    a `Status`; NaN where a recording lacks it
    disturbance (K+1, d) by `disturbance_names`: the wind (`wind_x`, [m/s]), measured less true state (`error_wx`), and
    what users added to a state at that step (`push_wx`)
    changes: parameters that were changed during the run; `scenario` is that of its start
    """

    scenario: Scenario
    plant: Plant
    states: Array
    commands: Array
    applied: Array
    reference: Array
    tracked_names: tuple[str, ...]
    amplitude: Array
    telemetry: Array
    telemetry_names: tuple[str, ...]
    solve_time_s: Array
    status: Array
    outcome: Outcome
    reason: str
    wall_time_s: float
    changes: tuple[ParameterChange, ...] = ()
    first_step: int = 0
    holes: tuple[tuple[int, int], ...] = ()
    disturbance: Array = field(default_factory=lambda: np.empty((0, 0)))
    disturbance_names: tuple[str, ...] = ()

    @property
    def time_s(self) -> Array:
        """Time of each state, shape (K+1,)."""
        return self.scenario.dt_s * (self.first_step + np.arange(len(self.states), dtype=np.float64))

    def since(self, step: int) -> "Run":
        """The same run without what lies before this step, one of its own."""
        rows = {name: getattr(self, name)[step - self.first_step :] for name in (*_OF_STATES, *_OF_STEPS)}
        return replace(
            self, first_step=step, holes=tuple(hole for hole in self.holes if hole[1] >= step), **rows
        )

    def until(self, step: int) -> "Run":
        """The same run with this step's state as its last one."""
        count = step - self.first_step
        rows = {name: getattr(self, name)[:count] for name in _OF_STEPS}
        rows |= {name: getattr(self, name)[: count + 1] for name in _OF_STATES}
        return replace(self, holes=tuple(hole for hole in self.holes if hole[0] < step), **rows)

    @cached_property
    def outputs(self) -> Array:
        """All outputs of the plant (K+1, L), by `plant.output_names`."""
        return self.plant.outputs(self.states)

    def output(self, name: str) -> Array:
        """One output of the plant (K+1,)."""
        return self.outputs[:, self.plant.output_names.index(name)]

    @property
    def tracks_outputs(self) -> bool:
        """True where the reference is for outputs, False where it is for controls (open loop)."""
        return set(self.tracked_names) <= set(self.plant.output_names)

    @cached_property
    def error(self) -> Array | None:
        """Tracked outputs less their reference (K+1, l); None for open loop."""
        if not self.tracks_outputs:
            return None
        columns = [self.plant.output_names.index(name) for name in self.tracked_names]
        difference: Array = self.outputs[:, columns] - self.reference
        for j, name in enumerate(self.tracked_names):
            if name in getattr(self.scenario.controller, "angles", ()):
                difference[:, j] -= 2.0 * np.pi * np.round(difference[:, j] / (2.0 * np.pi))
        difference.flags.writeable = False
        return difference

    @property
    def diverged_points(self) -> Array:
        """The number of sigma points that diverged in each step (K,); zero for a controller without any."""
        if DIVERGED_POINTS not in self.telemetry_names:
            return np.zeros(len(self.telemetry))
        return np.nan_to_num(self.telemetry[:, self.telemetry_names.index(DIVERGED_POINTS)])

    @property
    def warnings(self) -> tuple[str, ...]:
        """In words, in how many steps the controller could not do what it is for."""
        steps, lost = self.status_steps, self.diverged_points
        found = (
            (f"sigma points diverged, up to {lost.max(initial=0.0):g} at once", int(np.count_nonzero(lost))),
            ("the reference stayed out of reach", steps["not_reached"]),
            ("no control moved one of the outputs inside the horizon", steps["no_effect"]),
        )
        return tuple(f"in {count} of {len(lost)} steps {what}" for what, count in found if count)

    @property
    def status_steps(self) -> dict[str, int]:
        """Steps with each status, by its name in lower case."""
        return {status.name.lower(): int(np.sum(self.status == status)) for status in Status}
