"""What a flight leaves behind, as arrays."""

import operator
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.control.protocol import Status
from skydiver_utc.parameters import Scenario
from skydiver_utc.plant.skydiver import RATE_AT
from skydiver_utc.simulation.outcome import Outcome

_DELAY = "delay_steps"


class ParameterChange(NamedTuple):
    """From a step on a node worked with these parameters, all that differ from those of its start, by dotted name.

    A controller began there, from `control` (4,); None: as at the start of a flight. Its `delay_steps` is a
    parameter of the node and not of the scenario.
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
class Flight:
    """One closed-loop flight of K steps; row i belongs to step k = first_step + i, time k dt.

    first_step is 0 but for a recording that lacks the beginning.

    states (K+1, 13) position world [m], quaternion xyzw body to world, velocity body [m/s], rates body [rad/s]
    commands (K, 4) asked for by the controller; applied (K, 4) after the plant's own limits
    reference (K+1,) what the scenario's reference is for: a body rate [rad/s] or the pattern angle [rad]
    telemetry (K, n) by `telemetry_names`; of each controller call solve_time_s (K,) and status (K,), the number of
    a `Status`; NaN where a recording does not tell
    changes: parameters that were changed in flight; `scenario` is that of its start
    """

    scenario: Scenario
    states: NDArray[np.float64]
    commands: NDArray[np.float64]
    applied: NDArray[np.float64]
    reference: NDArray[np.float64]
    telemetry: NDArray[np.float64]
    telemetry_names: tuple[str, ...]
    solve_time_s: NDArray[np.float64]
    status: NDArray[np.float64]
    outcome: Outcome
    reason: str
    wall_time_s: float
    changes: tuple[ParameterChange, ...] = ()
    first_step: int = 0

    @property
    def time_s(self) -> NDArray[np.float64]:
        """Time of each state, shape (K+1,)."""
        steps: NDArray[np.float64] = self.first_step + np.arange(len(self.states), dtype=np.float64)
        return self.scenario.dt_s * steps

    def since(self, step: int) -> "Flight":
        """The same flight without what lies before this step, one of its own."""
        left_out = step - self.first_step
        names = ("states", "commands", "applied", "reference", "telemetry", "solve_time_s", "status")
        return replace(self, first_step=step, **{name: getattr(self, name)[left_out:] for name in names})

    @property
    def yaw_rate(self) -> NDArray[np.float64]:
        """Body rate about the dorsal axis [rad/s], shape (K+1,)."""
        return self.states[:, RATE_AT["yaw_rate"]]

    @property
    def pitch_rate(self) -> NDArray[np.float64]:
        """Body rate about the mediolateral axis [rad/s], head down positive, shape (K+1,)."""
        return self.states[:, RATE_AT["pitch_rate"]]

    @property
    def tracked(self) -> NDArray[np.float64] | None:
        """The body rate that the reference is for [rad/s], shape (K+1,); None where it is for the pattern angle."""
        row = RATE_AT.get(self.scenario.reference.signal)
        return None if row is None else self.states[:, row]

    @property
    def status_steps(self) -> dict[str, int]:
        """Steps with each status, by its name in lower case."""
        return {status.name.lower(): int(np.sum(self.status == status)) for status in Status}
