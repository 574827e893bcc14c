"""The pose controller: proportional on the tracked body rate with feed-forward (eq:lim)."""

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.control.limits import ControlLimits
from skydiver_utc.control.protocol import Decision, Status
from skydiver_utc.parameters import PoseControllerParameters

Array = NDArray[np.float64]


class PoseController:
    """Moves the pattern angle for the rate at `tracked` in the state; yaw damping is constant, the hands rest."""

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
        self._previous = self._initial.copy()

    def decide(self, state: Array, preview: Array) -> Decision:
        """u = K_p (yr_ref - yr_real) + K_FF yr_ref, bounded and slewed."""
        error = preview[0] - state[self._tracked]
        alpha = self._parameters.K_p * error + self._parameters.K_FF * preview[0]
        wanted = np.array([self._parameters.Cm_damp_yaw, 0.0, 0.0, alpha])
        control = self._limits.apply(wanted, self._previous)
        self._previous = control
        status = Status.SOLVED if control[3] == alpha else Status.SATURATED
        return Decision(control.copy(), np.array([error, alpha]), status)
