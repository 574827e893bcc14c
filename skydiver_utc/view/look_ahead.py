# SPDX-License-Identifier: Apache-2.0
"""The prediction of a controller, for the ghost of a flight."""

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.protocol import Controller
from skydiver_utc.controllers.utc.unscented_transform_controller import UnscentedTransformController
from skydiver_utc.plants.protocol import Plant
from skydiver_utc.references.protocol import Reference


def look_ahead(
    controller: Controller,
    model: Plant,
    reference: Reference,
    k: int,
    state: Array,
    control: Array,
    seconds: float,
) -> tuple[Array, Array]:
    """States (S, steps + 1, n) from a state (n,) at step k on, and what the actuators then hold (S, a).

    To the controller's horizon or, where that is further, so many seconds. Row 0: the model under the control in force
    (m,); the others, which only a UTC has: under its sigma points.
    """
    at_least = round(seconds / model.dt_s)
    if isinstance(controller, UnscentedTransformController):
        steps = max(controller.horizon, at_least)
        preview = reference.preview(k, steps + controller.preview_steps + 1)
        states, controls = controller.look_ahead(state, preview, steps)
    else:
        steps, controls = max(1, controller.preview_steps, at_least), control[np.newaxis]
        states = np.empty((1, steps + 1, len(state)))
        states[0, 0] = state
        for j in range(steps):
            model.bound_model.step(states[0, j], control, states[0, j + 1])
    applied = np.tile(model.initial_applied(), (len(states), 1))
    applied[:, : len(control)] = controls
    return states, applied
