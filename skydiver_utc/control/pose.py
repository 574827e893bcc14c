"""The pose controller: proportional on the tracked body rate with feed-forward (eq:lim)."""

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.control.limits import ControlLimits
from skydiver_utc.control.protocol import Decision, Status
from skydiver_utc.parameters import PoseControllerParameters

Array = NDArray[np.float64]


class PoseController:
    """Moves the pattern angle for the rate at `tracked` in the state; the hands rest."""

    preview_steps = 0
    telemetry_names: tuple[str, ...] = ("rate_error", "alpha_unlimited")

    def __init__(
        self, parameters: PoseControllerParameters, limits: ControlLimits, initial: Array, tracked: int
    ) -> None:
        self._parameters = parameters
        self._tracked = tracked
        self._limits = limits
        self._initial = initial
        self.reset()

    def reset(self) -> None:
        """Start again from the initial control."""
        self.resume(self._initial)

    def resume(self, control: Array) -> None:
        """Start from this control (4,), the one applied last."""
        self._previous = control.copy()

    def decide(self, state: Array, preview: Array) -> Decision:
        """u = K_p (yr_ref - yr_real) + K_FF yr_ref, bounded and slewed."""
        error = preview[0] - state[self._tracked]
        feed_forward = self._parameters.K_FF * preview[0]
        alpha = self._parameters.K_p * error + feed_forward
        wanted = np.array([self._damping(feed_forward), 0.0, 0.0, alpha])
        if not np.isfinite(wanted).all():
            return Decision(self._previous.copy(), np.zeros(len(self.telemetry_names)), Status.KEPT_PREVIOUS)
        control = self._limits.apply(wanted, self._previous)
        self._previous = control
        status = Status.SOLVED if control[3] == alpha else Status.SATURATED
        return Decision(control.copy(), np.array([error, alpha]), status)

    def _damping(self, feed_forward: float) -> float:
        """Constant, or lowered where the feed-forward asks for more than its largest pattern angle.

        In a steady turn the pattern's moment, near enough proportional to alpha, is that of the damping: Cm, and
        what the body itself adds to it, times the yaw rate. What alpha may not add, Cm must give way.
        """
        p = self._parameters
        if p.alpha_feed_forward_max > 0.0 and abs(feed_forward) > p.alpha_feed_forward_max:
            share = p.alpha_feed_forward_max / abs(feed_forward)
            return share * (p.Cm_damp_yaw + p.Cm_damp_body) - p.Cm_damp_body
        return p.Cm_damp_yaw
