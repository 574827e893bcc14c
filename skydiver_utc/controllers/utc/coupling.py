# SPDX-License-Identifier: Apache-2.0
"""The paper's coupling of the controls of a turning skydiver: the signs s12, s13 (eq_q1, eq_q3) and s14 (eq:s14)."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.utc.settings import Coupling

# In a straight fall the yaw damping must still be tried.
_LEAST_DEMAND = 0.02


class CouplingSchedule:
    """Pu at k = 0 and Qu at each step, from the signs of the reference and of its change.

    With `alpha_sign: damping`, which is not the paper's, alpha and the yaw damping brake one after the other: s14 is
    positive while there is damping to hand over to alpha and negative when there is none, and the negative
    eigenvalues that the printed numbers give Qu are dropped (docs/findings.md).

    variances (m, m) of the controls, without coupling; names of the controls, Cm_damp_yaw among them
    memory: s14 without the sign of the turn, and that sign, 0 before it is known, which a step hands to the next
    """

    def __init__(
        self, settings: Coupling, variances: Array, names: Sequence[str], Qu_ratio: float, dt_s: float
    ) -> None:
        missing = {"Cm_damp_yaw", "k_right", "k_left", "alpha"} - set(names)
        if missing:
            raise ValueError(
                f"coupling is for controls that this plant does not have: {', '.join(sorted(missing))}"
            )
        self._settings, self._variances = settings, variances
        self._signs, self._by_damping = settings.signs, settings.alpha_sign == "damping"
        self._row = names.index("Cm_damp_yaw")
        self._columns = [names.index(name) for name in ("k_right", "k_left", "alpha")]
        self._sizes = np.array([settings.k_right, settings.k_left, settings.alpha])
        self._k_hyst = round(settings.k_hyst_s / dt_s)
        self._full_change = settings.full_acceleration * dt_s
        # A run needs few of them again and again: eq:s14 flips its sign each step while the turn speeds up.
        self._scaled = lru_cache(maxsize=16)(lambda *found: Qu_ratio * self._noise(*found))
        self.reset()

    def reset(self) -> None:
        """Start from s14 = -1: to start turning, the yaw damping must be reduced."""
        self.memory = -1.0, 0.0

    def initial_covariance(self, preview: Array) -> Array:
        """Pu (m, m) at k = 0, with the raw s14 = -1 and the signs at the first step."""
        now, following = preview.item(0), preview.item(1)
        s12, s13 = self._hand_signs(now, following)
        return self._matrix(s12, s13, self._signed(-1.0, now, preview), 1.0)

    def process_noise(self, preview: Array, control: Array) -> Array:
        """Qu (m, m) at the step where the preview (count,) of the yaw rate starts; not to be written to.

        control (m,): the one in force
        """
        now, following = preview.item(0), preview.item(1)
        s12, s13 = self._hand_signs(now, following)
        if self._by_damping:
            s14 = 1.0 if control[self._row] > self._settings.low_damping else -1.0
        else:
            s14 = self._s14(now, following, preview)
        demand = 1.0 if self._full_change == 0.0 else self._demand(preview)
        return self._scaled(s12, s13, self._signed(s14, now, preview), demand)

    def _hand_signs(self, now: float, following: float) -> tuple[float, float]:
        match self._signs:
            case "yaw_rate":
                return _sign(now), -_sign(now)
            case "yaw_acceleration":
                return _sign(following - now), _sign(following - now)
            case _:
                return 0.0, 0.0

    def _s14(self, now: float, following: float, preview: Array) -> float:
        """eq:s14 without the sign of the turn; a sign of zero keeps the value before."""
        s14, turn = self.memory
        if s14 <= 0:
            now, following = preview.item(self._k_hyst), preview.item(self._k_hyst + 1)
        change = abs(following) - abs(now)
        if change != 0.0:
            s14 = -_sign(change)
            self.memory = s14, turn
        return s14

    def _signed(self, s14: float, now: float, preview: Array) -> float:
        """s14 times the sign of the turn; a run that starts from zero takes the sign of the turn to come."""
        before, turn = self.memory
        if now != 0.0:
            turn = _sign(now)
        elif turn == 0.0:
            coming = preview[preview != 0.0]
            turn = _sign(float(coming[0])) if len(coming) else 1.0
        self.memory = before, turn
        return s14 * turn

    def _demand(self, preview: Array) -> float:
        """The share of the row that is in force: the largest change ahead against that of full coupling."""
        return float(np.clip(np.abs(np.diff(preview)).max() / self._full_change, _LEAST_DEMAND, 1.0))

    def _noise(self, s12: float, s13: float, s14: float, demand: float) -> Array:
        matrix = self._matrix(s12, s13, s14, demand)
        if self._by_damping:
            values, vectors = np.linalg.eigh(matrix)
            matrix = (vectors * np.maximum(values, 0.0)) @ vectors.T
        return matrix

    def _matrix(self, s12: float, s13: float, s14: float, demand: float) -> Array:
        matrix, row = self._variances.copy(), self._row
        matrix[row, self._columns] = matrix[self._columns, row] = demand * self._sizes * (s12, s13, s14)
        matrix[row, row] *= demand
        return matrix


def _sign(value: float) -> float:
    """-1, 0 or 1."""
    return float((value > 0.0) - (value < 0.0))
