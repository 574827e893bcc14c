# SPDX-License-Identifier: Apache-2.0
"""Dynamics of a sigma point inside the horizon, other than being held: see `controllers.roll_out.Dynamics`."""

from collections.abc import Callable
from typing import Any

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.roll_out import Dynamics
from skydiver_utc.controllers.utc.settings import UtcSettings
from skydiver_utc.jit import program
from skydiver_utc.plants.function import in_form, tried
from skydiver_utc.plants.protocol import Plant


@program
def incremental(
    point: Array,
    before: Array,
    state: Array,
    y: Array,
    y_before: Array,
    preview: Array,
    j: int,
    numbers: Array,
    out: Array,
) -> None:
    """eq:m1utc for one control; numbers: which control, which output, K_p, K_FF, tau in steps.

    On [t_k+j, t_k+j+1) it takes the reference at k+j+1 and the output at k+j, the newest that is known when the control
    is set. The reference is the first of the preview.
    """
    c, output, K_p, K_FF, tau = int(numbers[0]), int(numbers[1]), numbers[2], numbers[3], int(numbers[4])
    for a in range(out.shape[0]):
        out[a] = point[a]
    own = point[c] if j == 0 else before[c]
    ahead = j + 1 + tau
    out[c] = (
        own
        + K_p * (preview[j + 1, 0] - preview[j, 0])
        - K_p * (y[output] - y_before[output])
        + K_FF * (preview[ahead, 0] - preview[ahead - 1, 0])
    )


def function(*_: Any) -> Any:
    """A name for the user's control dynamics, which the template below calls."""


def of_user(
    point: Array,
    before: Array,
    state: Array,
    y: Array,
    y_before: Array,
    preview: Array,
    j: int,
    numbers: Array,
    out: Array,
) -> None:
    """Control dynamics that return the control."""
    wanted = np.asarray(function(point, before, state, preview, j))
    if wanted.size != out.size:
        raise TypeError("it returns another number of controls")
    for a in range(out.shape[0]):
        out[a] = wanted[a]


def dynamics_of(
    settings: UtcSettings, plant: Plant, outputs: tuple[str, ...], own: Callable[..., Any] | None
) -> Dynamics | None:
    """The change of a sigma point's control inside the horizon, None if it is held. Raises ValueError.

    own: the user's function, which is jitted if the plant is
    """
    if own is not None:
        name, control = "dynamics", plant.initial_control()
        if not callable(own):
            raise ValueError(
                f"{name} must be a function (point, control, state, preview, j) -> control, not {own!r}."
            )
        preview = np.zeros((settings.preview_steps(plant.dt_s) + 1, len(outputs)))
        shape = tried(name, own, control.copy(), control.copy(), plant.initial_state(), preview, 0).shape
        if shape != control.shape:
            raise ValueError(f"{name} returns shape {shape} for a control of shape {control.shape}.")
        return Dynamics(in_form(of_user, own, plant.model.step, name), np.empty(0), False)
    if settings.dynamics is None:
        return None
    d = settings.dynamics
    if d.control not in plant.control_names:
        raise ValueError(
            f"dynamics.control: there is no {d.control}, the plant has {', '.join(plant.control_names)}"
        )
    tau = round(d.tau_s / plant.dt_s)
    at = plant.control_names.index(d.control), plant.output_names.index(outputs[0])
    return Dynamics(incremental, np.array([*at, d.K_p, d.K_FF, tau], dtype=float), True)
