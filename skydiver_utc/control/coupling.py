"""How the process noise couples the controls: the signs s12, s13 (eq_q1, eq_q3) and s14 (eq:s14)."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.parameters import UtcParameters

Array = NDArray[np.float64]

# In a straight fall the yaw damping must still be tried.
_LEAST_DEMAND = 0.02


class CouplingSchedule:
    """Gives Pu at k = 0 and Qu at each step, from the signs of the reference and of its change."""

    def __init__(self, parameters: UtcParameters, k_hyst: int, dt_s: float) -> None:
        self._parameters = parameters
        self._k_hyst = k_hyst
        self._full_change = parameters.full_coupling_acceleration * dt_s
        self._uncoupled = np.diag(
            [
                parameters.variance_Cm_damp_yaw,
                parameters.variance_k_right,
                parameters.variance_k_left,
                parameters.variance_alpha,
            ]
        )
        # A flight needs few of them again and again: eq:s14 flips its sign each step while the turn speeds up.
        self._scaled = lru_cache(maxsize=16)(lambda *found: parameters.Qu_ratio * self._matrix(*found))
        self.reset()

    def reset(self) -> None:
        """Start from s14 = -1: to start turning, the yaw damping must be reduced."""
        self._s14_raw = -1.0
        self._rate_sign = 0.0

    def initial_covariance(self, preview: Array) -> Array:
        """Pu (4, 4) at k = 0, with the raw s14 = -1 and the coupling's signs at the first step."""
        now, following = preview[:2].tolist()
        s12, s13 = self._hand_signs(now, following)
        return self._matrix(s12, s13, self._signed(-1.0, now, preview), 1.0)

    def process_noise(self, preview: Array) -> Array:
        """Qu (4, 4) at the step where the reference preview [rad/s] starts; not to be written to."""
        now, following = preview[:2].tolist()
        s12, s13 = self._hand_signs(now, following)
        return self._scaled(s12, s13, self._s14(now, following, preview), self._demand(preview))

    def _hand_signs(self, now: float, following: float) -> tuple[float, float]:
        match self._parameters.coupling:
            case "yaw_rate":
                sign = _sign(now)
                return sign, -sign
            case "yaw_acceleration":
                sign = _sign(following - now)
                return sign, sign
            case _:
                return 0.0, 0.0

    def _s14(self, now: float, following: float, preview: Array) -> float:
        """eq:s14; a sign of zero keeps the value before."""
        reading = self._parameters.s14_recursion_reading
        ahead = reading == "look_ahead" or (reading == "printed" and self._s14_raw <= 0)
        if ahead:
            before, after = preview[self._k_hyst : self._k_hyst + 2].tolist()
        else:
            before, after = now, following
        change = abs(after) - abs(before)
        if change != 0.0:
            self._s14_raw = -_sign(change)
        return self._signed(self._s14_raw, now, preview)

    def _signed(self, s14: float, now: float, preview: Array) -> float:
        """s14 times the sign of the turn; a flight that starts from zero takes the sign of the turn to come."""
        if self._parameters.s14_sign_reading == "printed":
            return s14
        if now != 0.0:
            self._rate_sign = _sign(now)
        elif self._rate_sign == 0.0:
            coming = preview[np.flatnonzero(preview)[:1]]
            self._rate_sign = _sign(float(coming[0])) if len(coming) else 1.0
        return s14 * self._rate_sign

    def _demand(self, preview: Array) -> float:
        """How much of the row of Cm_damp is in force: the largest change ahead against that of full coupling."""
        if self._full_change == 0.0:
            return 1.0
        return float(np.clip(np.abs(np.diff(preview)).max() / self._full_change, _LEAST_DEMAND, 1.0))

    def _matrix(self, s12: float, s13: float, s14: float, demand: float) -> Array:
        p = self._parameters
        matrix = self._uncoupled.copy()
        matrix[0, 1] = matrix[1, 0] = s12 * p.covariance_12
        matrix[0, 2] = matrix[2, 0] = s13 * p.covariance_13
        matrix[0, 3] = matrix[3, 0] = s14 * p.covariance_14
        matrix[0, 0] *= demand
        matrix[0, 1:] *= demand
        matrix[1:, 0] *= demand
        return matrix


def _sign(value: float) -> float:
    """-1, 0 or 1."""
    return float((value > 0.0) - (value < 0.0))
