"""A controller at states that are given, without a plant: it is asked, it does not fly."""

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.control.protocol import Controller
from skydiver_utc.plant.skydiver import CONTROL_NAMES

Array = NDArray[np.float64]


def decide_again(controller: Controller, states: Array, reference: Array) -> Array:
    """Commands (K, 4) of a controller that starts anew at states (K+1, 13), reference (K + preview_steps,)."""
    controller.reset()
    steps, width = len(states) - 1, controller.preview_steps + 1
    commands = np.empty((steps, len(CONTROL_NAMES)))
    for k in range(steps):
        # Copies, as a node has them: no controller can change what it is asked next.
        commands[k] = controller.decide(states[k].copy(), reference[k : k + width].copy()).control
    return commands
