# SPDX-License-Identifier: Apache-2.0
"""A controller's decisions at given states, without a plant."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.controllers.protocol import Controller
from skydiver_utc.estimators.protocol import Estimator

Array = NDArray[np.float64]


class Stretch(NamedTuple):
    """Controller and estimator from row `first` to the next stretch; resumed from a control (m,) or reset."""

    first: int
    controller: Controller
    estimator: Estimator
    control: Array | None


def decide_at(stretches: Sequence[Stretch], states: Array, applied: Array, reference: Array) -> Array:
    """Commands (K, m) at states (K+1, n), applied controls (K, m), reference (K + longest preview, l).

    The first stretch begins at row 0.
    """
    commands = np.empty_like(applied)
    ends = [stretch.first for stretch in stretches[1:]] + [len(applied)]
    for (first, controller, estimator, control), end in zip(stretches, ends, strict=True):
        estimator.reset()
        if control is None:
            controller.reset()
        else:
            controller.resume(control)
        width = controller.preview_steps + 1
        for k in range(first, end):
            # Copies, as a node has them: no controller can change what it is given next.
            estimate = estimator.update(states[k].copy())
            commands[k] = controller.decide(estimate, reference[k : k + width].copy()).control
            estimator.predict(applied[k])
    return commands
