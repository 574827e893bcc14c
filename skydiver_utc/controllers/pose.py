# SPDX-License-Identifier: Apache-2.0
"""The skydiver's pose controller: proportional on the tracked body rate with feed-forward (eq:lim)."""

from typing import NamedTuple

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.limits import KEPT_PREVIOUS, SATURATED, SOLVED, LimitedController, limit
from skydiver_utc.controllers.protocol import Decision
from skydiver_utc.controllers.settings import PoseSettings
from skydiver_utc.jit import by_address, contents, unfused
from skydiver_utc.plants.protocol import Plant


class Pose(NamedTuple):
    """Numbers of a decision: places of output and controls, settings, limits (3, m), the control before (m,)."""

    output: int
    damping_at: int
    alpha_at: int
    K_p: float
    K_FF: float
    Cm_damp_yaw: float
    Cm_damp_body: float
    alpha_feed_forward_max: float
    limits: Array
    previous: Array


class PoseController(LimitedController):
    """Moves the pattern angle `alpha` for the first output of the reference; the hands rest."""

    preview_steps = 0
    telemetry_names: tuple[str, ...] = ("rate_error", "alpha_unlimited")

    def __init__(
        self, settings: PoseSettings, plant: Plant, outputs: tuple[str, ...], dt_s: float, seed: int = 0
    ) -> None:
        if {"Cm_damp_yaw", "alpha"} - set(plant.control_names):
            raise ValueError("the pose controller is for a plant with the controls Cm_damp_yaw and alpha")
        super().__init__(plant)
        self._outputs_of, self._outputs = plant.bound_model.outputs, np.empty(len(plant.output_names))
        self._out = np.empty(len(self.telemetry_names) + 1)
        numbers = Pose(
            plant.output_names.index(outputs[0]),
            plant.control_names.index("Cm_damp_yaw"),
            plant.control_names.index("alpha"),
            settings.K_p,
            settings.K_FF,
            settings.Cm_damp_yaw,
            settings.Cm_damp_body,
            settings.alpha_feed_forward_max,
            self._limits,
            self._previous,
        )
        self._move = by_address([(move, numbers)], self._outputs, np.empty((1, len(outputs))), self._out)

    def decide(self, state: Array, preview: Array) -> Decision:
        """u = K_p (yr_ref - yr_real) + K_FF yr_ref, bounded and slewed."""
        out = self._out
        self._outputs_of(state, self._outputs)
        self._move(self._outputs, preview, out)
        return self._decision(out)


@unfused
def move(outputs: Array, preview: Array, numbers: Pose, out: Array) -> None:
    """Move the control on; write the error of the rate, alpha without limits, and the status.

    Cm is constant, or lowered where the feed-forward asks for more than its largest pattern angle: in a steady turn the
    pattern's moment, near enough proportional to alpha, is that of the damping, Cm and what the body itself adds to it,
    times the yaw rate. What alpha may not add, Cm must give way.
    """
    p = contents(numbers)
    error = preview[0, 0] - outputs[p.output]
    feed_forward = p.K_FF * preview[0, 0]
    alpha = p.K_p * error + feed_forward
    if not abs(alpha) < np.inf:
        out[0], out[1], out[2] = 0.0, 0.0, KEPT_PREVIOUS
        return
    wanted = np.zeros(p.previous.shape[0])
    wanted[p.damping_at], wanted[p.alpha_at] = p.Cm_damp_yaw, alpha
    if 0.0 < p.alpha_feed_forward_max < abs(feed_forward):
        share = p.alpha_feed_forward_max / abs(feed_forward)
        wanted[p.damping_at] = share * (p.Cm_damp_yaw + p.Cm_damp_body) - p.Cm_damp_body
    limit(wanted, p.limits, p.previous)
    out[0], out[1] = error, alpha
    out[2] = SOLVED if p.previous[p.alpha_at] == alpha else SATURATED
