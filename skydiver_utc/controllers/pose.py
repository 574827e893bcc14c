# SPDX-License-Identifier: Apache-2.0
"""The skydiver's pose controller: proportional on the tracked body rate with feed-forward (eq:lim)."""

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.controllers.limits import LimitedController, all_finite, limited
from skydiver_utc.controllers.protocol import Decision, Status
from skydiver_utc.controllers.settings import PoseSettings
from skydiver_utc.plants.protocol import Plant

Array = NDArray[np.float64]


class PoseController(LimitedController):
    """Moves the pattern angle `alpha` for the first output of the reference; the hands rest."""

    preview_steps = 0
    telemetry_names: tuple[str, ...] = ("rate_error", "alpha_unlimited")

    def __init__(
        self, settings: PoseSettings, plant: Plant, outputs: tuple[str, ...], dt_s: float, seed: int = 0
    ) -> None:
        if {"Cm_damp_yaw", "alpha"} - set(plant.control_names):
            raise ValueError("the pose controller is for a plant with the controls Cm_damp_yaw and alpha")
        self._settings = settings
        self._plant, self._outputs = plant, np.empty(len(plant.output_names))
        self._output = plant.output_names.index(outputs[0])
        self._damping_at, self._alpha_at = map(plant.control_names.index, ("Cm_damp_yaw", "alpha"))
        super().__init__(plant)

    def decide(self, state: Array, preview: Array) -> Decision:
        """u = K_p (yr_ref - yr_real) + K_FF yr_ref, bounded and slewed."""
        reference = float(preview[0, 0])
        self._plant.bound_model.outputs(state, self._outputs)
        error = reference - float(self._outputs[self._output])
        feed_forward = self._settings.K_FF * reference
        alpha = self._settings.K_p * error + feed_forward
        wanted = np.zeros(len(self._previous))
        wanted[self._damping_at], wanted[self._alpha_at] = self._damping(feed_forward), alpha
        if not all_finite(wanted):
            return Decision(self._previous.copy(), np.zeros(len(self.telemetry_names)), Status.KEPT_PREVIOUS)
        self._previous = limited(wanted, self._previous, self._limits)
        status = Status.SOLVED if self._previous[self._alpha_at] == alpha else Status.SATURATED
        return Decision(self._previous.copy(), np.array([error, alpha]), status)

    def _damping(self, feed_forward: float) -> float:
        """Constant, or lowered where the feed-forward asks for more than its largest pattern angle.

        In a steady turn the pattern's moment, near enough proportional to alpha, is that of the damping: Cm, and
        what the body itself adds to it, times the yaw rate. What alpha may not add, Cm must give way.
        """
        p = self._settings
        if p.alpha_feed_forward_max > 0.0 and abs(feed_forward) > p.alpha_feed_forward_max:
            share = p.alpha_feed_forward_max / abs(feed_forward)
            return share * (p.Cm_damp_yaw + p.Cm_damp_body) - p.Cm_damp_body
        return p.Cm_damp_yaw
