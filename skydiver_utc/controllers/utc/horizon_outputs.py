# SPDX-License-Identifier: Apache-2.0
"""The outputs that a step of UTC predicts: their names, the covariance of their errors, constant references, angles."""

import numpy as np

from skydiver_utc.arrays import Array, Integers
from skydiver_utc.controllers.utc.settings import Covariance, UtcSettings, matrix
from skydiver_utc.plants.protocol import Plant

# sqrt(P_err) as a share of what the initial Pu moves an output, where no P_err is given.
_SHARE_OF_SPREAD = 0.1
# An output that moves less than this share of itself is moved by rounding.
_ROUNDING = 1e-12


class HorizonOutputs:
    """Y (L,): at each step of the horizon that counts the tracked and the further outputs, then nominal controls.

    P_err (L, L) and reference (L,) are the arrays that the law works with; nominal: indices of controls; angles: of Y
    """

    def __init__(self, settings: UtcSettings, plant: Plant, tracked: tuple[str, ...]) -> None:
        self.tracked, self.names = tracked, (*tracked, *settings.outputs)
        for block, given, known in (
            ("outputs", settings.outputs, plant.output_names), ("angles", settings.angles, self.names),
        ):  # fmt: skip
            if unknown := set(given) - set(known):
                raise ValueError(f"{block}.{unknown.pop()}: the outputs are {', '.join(known)}")
        self.selected = [plant.output_names.index(name) for name in self.names]
        self.nominal = np.array([plant.control_names.index(n) for n in settings.nominal], dtype=np.int64)
        self._weight_beside = 1.0 - settings.W0
        self._steps, self._further = len(settings.steps), [o.P_err for o in settings.outputs.values()]
        count = len(self.names)
        self.size = size = count * self._steps
        self.angles = np.array(
            [k for k in range(size) if self.names[k % count] in settings.angles], dtype=np.int64
        )
        self.P_err = np.eye(size + len(self.nominal))
        self.reference = np.zeros(len(self.P_err))
        for k, output in enumerate(settings.outputs.values()):
            self.reference[len(tracked) + k : size : count] = output.reference
        for k, nominal in enumerate(settings.nominal.values()):
            self.P_err[size + k, size + k], self.reference[size + k] = nominal.variance, nominal.value
        # Indices of the tracked outputs whose P_err is not known yet.
        self.not_known = set(range(len(tracked))) if settings.P_err is None else set[int]()
        if settings.P_err is not None:
            self.set_error(settings.P_err)

    @property
    def of_tracked(self) -> Integers:
        """Indices (T, l) of the tracked outputs in Y."""
        return np.arange(self.size).reshape(self._steps, len(self.names))[:, : len(self.tracked)]

    @property
    def error(self) -> Array:
        """P_err (l, l) of the tracked outputs at one step of the horizon; NaN for one that is not known yet."""
        l = len(self.tracked)
        found = self.P_err[:l, :l].copy()
        unknown = sorted(self.not_known)
        found[unknown, unknown] = np.nan
        return found

    def set_error(self, given: Covariance) -> None:
        """Let P_err be one variance for all tracked outputs, one for each, or a matrix. Raises ValueError."""
        found = matrix("P_err", given, self.tracked)
        if not np.linalg.eigvalsh(found)[0] > 0.0:
            raise ValueError("P_err must be positive definite")
        self._set_error(found)
        self.not_known.clear()

    def derive_error(self, outputs: Array, share: float) -> None:
        """Take what is not known of P_err from outputs (2m+1, T l) of initial sigma points, drawn at a share
        of their distance.
        """
        l, found = len(self.tracked), self.P_err[: len(self.tracked), : len(self.tracked)].copy()
        beside = self.differences(outputs[1:] - outputs[0], np.arange(self.size))
        alive = np.isfinite(beside).all(axis=1)
        if not alive.any():
            return
        moved = np.sqrt(self._weight_beside * np.mean(np.square(beside[alive]), axis=0))
        moved[moved <= _ROUNDING * np.nanmax(np.abs(outputs), axis=0)] = 0.0
        moved = moved.reshape(self._steps, len(self.names))[:, :l].max(axis=0) / share
        for k in [k for k in self.not_known if moved[k] > 0.0]:
            found[k, k] = (_SHARE_OF_SPREAD * moved[k]) ** 2
            self.not_known.discard(k)
        self._set_error(found)

    def differences(self, found: Array, columns: Integers) -> Array:
        """Differences (..., c) of these columns of Y, those of angles on the circle."""
        if not len(self.angles):
            return found
        turns = np.where(np.isin(columns, self.angles), np.round(found / (2.0 * np.pi)), 0.0)
        return found - 2.0 * np.pi * turns

    def _set_error(self, tracked: Array) -> None:
        of_step = np.diag([*tracked.diagonal(), *self._further])
        of_step[: len(self.tracked), : len(self.tracked)] = tracked
        self.P_err[: self.size, : self.size] = np.kron(np.eye(self._steps), of_step)
