# SPDX-License-Identifier: Apache-2.0
"""The interface of a reference to the closed loop."""

from typing import Protocol

from skydiver_utc.arrays import Array


class Reference(Protocol):
    """The wanted outputs of the plant at each step; made as `Class(settings, dt_s)`.

    outputs: names of the plant's outputs that the reference is for (l of them), or of its controls for open loop
    amplitude: largest absolute value of each (l,), 0 where there is none; a run has converged inside 5 % of it
    """

    outputs: tuple[str, ...]
    amplitude: Array

    def preview(self, k: int, count: int) -> Array:
        """Values (count, l) at the steps k, k+1, ...; the same bits for the same step in every preview."""
        ...
