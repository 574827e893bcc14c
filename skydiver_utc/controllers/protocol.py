# SPDX-License-Identifier: Apache-2.0
"""The interface of a controller to the closed loop."""

from enum import IntEnum
from typing import NamedTuple, Protocol

from skydiver_utc.arrays import Array

# The telemetry of a controller that counts the sigma points which diverged in a decision.
DIVERGED_POINTS = "diverged_points"


class Status(IntEnum):
    """The outcome of one decision; of several, the one with the highest number. Printed, it is a word.

    SATURATED: a control is on a bound or at its largest change; REPAIRED: numbers were repaired or points left out;
    KEPT_PREVIOUS: there was no answer; NO_EFFECT: no control moves one of the outputs inside the horizon;
    NOT_REACHED: the distance to a reference that stands still has long been large and hardly shrinks
    """

    SOLVED = 0
    SATURATED = 1
    REPAIRED = 2
    KEPT_PREVIOUS = 3
    NOT_REACHED = 4
    NO_EFFECT = 5

    def __str__(self) -> str:
        return self.name.lower()

    def __format__(self, spec: str) -> str:
        return format(str(self), spec)


class Decision(NamedTuple):
    """A control (m,), the named values behind it (n,), and a status."""

    control: Array
    telemetry: Array
    status: Status


class Controller(Protocol):
    """Decides the control that acts on [t_k, t_k+1) from the state at t_k.

    Made as `Class(settings, plant, outputs, dt_s, seed)`.

    outputs: names of the plant's outputs that the reference is for (l of them)
    """

    preview_steps: int
    telemetry_names: tuple[str, ...]

    def reset(self) -> None:
        """Start again as at step 0."""

    def resume(self, control: Array) -> None:
        """Warm start: continue a run in which this control (m,) was applied last."""

    def decide(self, state: Array, preview: Array) -> Decision:
        """Control for the state (n,) at k and the reference (preview_steps + 1, l) at k, k+1, ..."""
        ...
