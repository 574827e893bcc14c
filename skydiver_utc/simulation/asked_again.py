"""A controller at states that are given, without a plant: it is asked, it does not fly."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.control.protocol import Controller
from skydiver_utc.plant.skydiver import CONTROL_NAMES

Array = NDArray[np.float64]


class Stretch(NamedTuple):
    """From row `first` on, up to the next stretch, this controller answers, begun from a control (4,) or anew."""

    first: int
    controller: Controller
    control: Array | None


def decide_again(stretches: Sequence[Stretch], states: Array, reference: Array) -> Array:
    """Commands (K, 4) at states (K+1, 13) and reference (K + longest preview,); a stretch begins at row 0."""
    steps = len(states) - 1
    ends = [stretch.first for stretch in stretches[1:]] + [steps]
    commands = np.empty((steps, len(CONTROL_NAMES)))
    for (first, controller, control), end in zip(stretches, ends, strict=True):
        if control is None:
            controller.reset()
        else:
            controller.resume(control)
        width = controller.preview_steps + 1
        for k in range(first, end):
            # Copies, as a node has them: no controller can change what it is asked next.
            commands[k] = controller.decide(states[k].copy(), reference[k : k + width].copy()).control
    return commands
