"""Bounds and slew rates of a control vector."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class ControlLimits(NamedTuple):
    """minimum, maximum and largest change per step, each (m,); a change without limit is inf."""

    minimum: Array
    maximum: Array
    slew: Array

    def apply(self, wanted: Array, previous: Array) -> Array:
        """Bound a control (m,), then keep its change from the previous one within the slew limit."""
        # Not np.clip: called each control step on a few numbers, it costs several times as much.
        bounded = np.minimum(np.maximum(wanted, self.minimum), self.maximum)
        slewed: Array = np.minimum(np.maximum(bounded, previous - self.slew), previous + self.slew)
        return slewed
