"""What every controller offers to the closed loop."""

from enum import IntEnum
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Status(IntEnum):
    """What happened in one decision; of several, the gravest."""

    SOLVED = 0
    SATURATED = 1
    REPAIRED = 2
    KEPT_PREVIOUS = 3


class Decision(NamedTuple):
    """A control (4,), the named values behind it (n,), and a status."""

    control: Array
    telemetry: Array
    status: Status


class Controller(Protocol):
    """Decides the control that acts on [t_k, t_k+1) from the state at t_k."""

    preview_steps: int
    telemetry_names: tuple[str, ...]

    def reset(self) -> None:
        """Forget the flight so far."""

    def resume(self, control: Array) -> None:
        """Come into a flight that goes on: forget the flight so far, begin from this control (4,)."""

    def decide(self, state: Array, preview: Array) -> Decision:
        """Control for the state (13,) and the reference preview (preview_steps + 1,) at k, k+1, ... [rad/s]."""
        ...
