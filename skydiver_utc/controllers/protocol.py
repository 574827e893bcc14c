# SPDX-License-Identifier: Apache-2.0
"""The interface of a controller to the closed loop."""

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
