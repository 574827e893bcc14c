"""Open loop: the posture follows the reference, whatever the body does."""

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.control.limits import ControlLimits
from skydiver_utc.control.protocol import Decision, Status
from skydiver_utc.parameters import OpenLoopParameters

Array = NDArray[np.float64]


class OpenLoop:
    """Asks for the pattern angle of the reference; yaw damping is constant and the hands rest."""

    preview_steps = 0
    telemetry_names: tuple[str, ...] = ("alpha_unlimited",)

    def __init__(self, parameters: OpenLoopParameters, limits: ControlLimits, initial: Array) -> None:
        self._parameters = parameters
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
        """The pattern angle [rad] of the reference, bounded and slewed."""
        wanted = np.array([self._parameters.Cm_damp_yaw, 0.0, 0.0, preview[0]])
        control = self._limits.apply(wanted, self._previous)
        self._previous = control
        status = Status.SOLVED if control[3] == preview[0] else Status.SATURATED
        return Decision(control.copy(), preview[:1].copy(), status)
