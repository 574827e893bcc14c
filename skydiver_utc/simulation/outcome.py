"""How a flight ended, in one word and one sentence."""

from enum import Enum

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.parameters import Scenario

# A body faster than this has left the model, whatever its numbers say.
LARGEST_SPEED_M_S = 500.0
LARGEST_RATE_RAD_S = 200.0


class Outcome(str, Enum):
    """How a flight ended."""

    COMPLETED = "completed"
    ROLLED_OVER = "rolled_over"
    DIVERGED = "diverged"
    NO_COMMAND = "no_command"
    NO_CLOCK = "no_clock"
    ABORTED = "aborted"


class OutcomeMonitor:
    """Watches the states of a flight; rolling over counts where the scenario is belly to earth."""

    def __init__(self, scenario: Scenario) -> None:
        self._belly_to_earth = scenario.belly_to_earth
        self._dt_s = scenario.dt_s
        self.outcome = Outcome.COMPLETED
        self.reason = f"{scenario.steps} steps flown"

    def observe(self, k: int, state: NDArray[np.float64]) -> bool:
        """Take in the state (13,) at step k; False when the flight cannot go on."""
        speed, rate = speed_and_rate(state)
        if not (speed < LARGEST_SPEED_M_S and rate < LARGEST_RATE_RAD_S and np.isfinite(state).all()):
            self.outcome = Outcome.DIVERGED
            self.reason = (
                f"the state left the model at {k * self._dt_s:.3f} s"
                f" (speed {speed:.3g} m/s, body rate {rate:.3g} rad/s)"
            )
            return False
        upright = not self._belly_to_earth or dorsal_axis_height(state) >= 0.0
        if self.outcome is Outcome.COMPLETED and not upright:
            self.outcome = Outcome.ROLLED_OVER
            self.reason = f"the dorsal axis went below the horizon at {k * self._dt_s:.3f} s"
        return True

    def end(self, outcome: Outcome, reason: str) -> None:
        """The flight was ended from outside."""
        self.outcome, self.reason = outcome, reason


def speed_and_rate(state: NDArray[np.float64]) -> tuple[float, float]:
    """Speed [m/s] and size of the body rate [rad/s] of a state (13,)."""
    with np.errstate(over="ignore", invalid="ignore"):
        return float(np.sqrt(state[7:10] @ state[7:10])), float(np.sqrt(state[10:13] @ state[10:13]))


def world_up(states: NDArray[np.float64]) -> NDArray[np.float64]:
    """The world's up direction (..., 3) in body axes for states (..., 13)."""
    x, y, z, w = np.moveaxis(states[..., 3:7], -1, 0)
    return np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], axis=-1)


def dorsal_axis_height(states: NDArray[np.float64]) -> NDArray[np.float64]:
    """Height (...) of the dorsal axis for states (..., 13): 1 belly to earth, -1 back to earth."""
    height: NDArray[np.float64] = 1.0 - 2.0 * (states[..., 3] ** 2 + states[..., 4] ** 2)
    return height
