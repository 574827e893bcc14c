# SPDX-License-Identifier: Apache-2.0
"""The skydiver's pose controller: proportional on the tracked body rate with feed-forward (eq:lim)."""

import math

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.limits import LimitedController, limit
from skydiver_utc.controllers.protocol import Decision, Status
from skydiver_utc.controllers.settings import PoseSettings
from skydiver_utc.plants.protocol import Plant


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
        self._settings, self._output = settings, plant.output_names.index(outputs[0])
        self._damping_at, self._alpha_at = map(plant.control_names.index, ("Cm_damp_yaw", "alpha"))
        self._outputs_of, self._outputs = plant.bound_model.outputs, np.empty(len(plant.output_names))

    def decide(self, state: Array, preview: Array) -> Decision:
        """u = K_p (yr_ref - yr_real) + K_FF yr_ref, bounded and slewed.

        Cm is constant, or lowered where the feed-forward asks for more than its largest pattern angle: in a steady
        turn the pattern's moment, near enough proportional to alpha, is that of the damping, Cm and what the body
        itself adds to it, times the yaw rate. What alpha may not add, Cm must give way.
        """
        p, wanted = self._settings, np.zeros(len(self._previous))
        self._outputs_of(state, self._outputs)
        reference = float(preview[0, 0])
        error, feed_forward = reference - float(self._outputs[self._output]), p.K_FF * reference
        alpha, damping = p.K_p * error + feed_forward, p.Cm_damp_yaw
        if not math.isfinite(alpha):
            return Decision(self._previous.copy(), np.zeros(2), Status.KEPT_PREVIOUS)
        if 0.0 < p.alpha_feed_forward_max < abs(feed_forward):
            share = p.alpha_feed_forward_max / abs(feed_forward)
            damping = share * (p.Cm_damp_yaw + p.Cm_damp_body) - p.Cm_damp_body
        wanted[self._damping_at], wanted[self._alpha_at] = damping, alpha
        limit(wanted, self._limits, self._previous)
        status = Status.SOLVED if self._previous[self._alpha_at] == alpha else Status.SATURATED
        return Decision(self._previous.copy(), np.array([error, alpha]), status)
