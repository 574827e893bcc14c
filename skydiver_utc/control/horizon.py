"""What Gauss-Newton and path-integral control share: the horizon's grid, its control sequence and its cost.

The horizon has N model steps of `periods` control periods each, cut into B blocks of equal length. A control
sequence (B, m) holds one control per block. A control without a rate limit jumps at the start of its block and is
held; one with a rate limit moves evenly over the block and is there at its end, so that the rate limit bounds the
difference of two neighbours. With y_j the output after j model steps and r_j its reference, both minimise

    J = 1/N sum_j (y_j - r_j)^2 + 1/B sum_b sum_c w_c (U_b,c - rest_c)^2 + 1/B sum_b sum_c s_c (U_b,c - U_b-1,c)^2

where U_-1 is the control applied last.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.control.limits import ControlLimits
from skydiver_utc.jit import kernel

Array = NDArray[np.float64]

# roll_out(state, control applied last (m,), sequences (S, B, m), outputs (S, N)) writes y_1 .. y_N of each.
RollOut = Callable[[Array, Array, Array, Array], None]


class Horizon(NamedTuple):
    """N model steps of `periods` control periods, in B blocks; N is a multiple of B."""

    steps: int
    blocks: int
    periods: int

    @property
    def block_periods(self) -> int:
        """Control periods in one block."""
        return self.steps // self.blocks * self.periods

    @property
    def preview_steps(self) -> int:
        """Control periods in the whole horizon."""
        return self.steps * self.periods

    def reference(self, preview: Array) -> Array:
        """r_1 .. r_N, shape (N,), from a preview by control periods that starts now."""
        return np.ascontiguousarray(preview[self.periods : self.preview_steps + 1 : self.periods])


class HorizonCost(NamedTuple):
    """w (m,) on the distance from rest (m,), s (m,) on changes from block to block."""

    control: Array
    change: Array
    rest: Array


@kernel
def cost_of(sequence: Array, applied: Array, outputs: Array, reference: Array, cost: HorizonCost) -> float:
    """J of one sequence (B, m) with its outputs (N,)."""
    tracking, effort = 0.0, 0.0
    for j in range(reference.shape[0]):
        tracking += (outputs[j] - reference[j]) ** 2
    for b in range(sequence.shape[0]):
        for c in range(sequence.shape[1]):
            before = sequence[b - 1, c] if b > 0 else applied[c]
            effort += cost.control[c] * (sequence[b, c] - cost.rest[c]) ** 2
            effort += cost.change[c] * (sequence[b, c] - before) ** 2
    cost_of_all: float = tracking / reference.shape[0] + effort / sequence.shape[0]
    return cost_of_all


def first_period(sequence: Array, applied: Array, limits: ControlLimits, horizon: Horizon) -> Array:
    """The control (m,) of a sequence's first control period."""
    first = sequence[0].copy()
    moving = np.isfinite(limits.slew)
    first[moving] = applied[moving] + (first[moving] - applied[moving]) / horizon.block_periods
    return limits.apply(first, applied)


def one_period_on(sequence: Array, horizon: Horizon) -> Array:
    """The sequence (B, m) as seen one control period later, the last block held on."""
    following = np.vstack([sequence[1:], sequence[-1:]])
    moved: Array = sequence + (following - sequence) / horizon.block_periods
    return moved
