# SPDX-License-Identifier: Apache-2.0
"""The end of a run in one word and one sentence."""

from enum import Enum

from skydiver_utc.arrays import Array
from skydiver_utc.parameters import Scenario
from skydiver_utc.plants.protocol import Plant


class Outcome(str, Enum):
    """The end of a run."""

    COMPLETED = "completed"
    ROLLED_OVER = "rolled_over"
    DIVERGED = "diverged"
    NO_COMMAND = "no_command"
    ABORTED = "aborted"


REACHED_THE_END = (Outcome.COMPLETED, Outcome.ROLLED_OVER)


class OutcomeMonitor:
    """Watches the states of a run: a fault of the plant ends it, a mishap is recorded and the run continues."""

    def __init__(self, scenario: Scenario, plant: Plant) -> None:
        self._plant, self._dt_s = plant, scenario.dt_s
        self.outcome = Outcome.COMPLETED
        self.reason = f"{scenario.steps} steps done"

    def observe(self, k: int, state: Array) -> bool:
        """Check the state (n,) at step k; False when the run cannot go on."""
        if fault := self._plant.fault(state):
            self.end(Outcome.DIVERGED, f"{fault} at {k * self._dt_s:.3f} s")
            return False
        if self.outcome is Outcome.COMPLETED and (mishap := self._plant.mishap(state)):
            self.end(Outcome.ROLLED_OVER, f"{mishap} at {k * self._dt_s:.3f} s")
        return True

    def end(self, outcome: Outcome, reason: str) -> None:
        """The run was ended from outside."""
        self.outcome, self.reason = outcome, reason
