"""The iterated update: sigma points are drawn again from where the update has led, and the update is done again.

The plant's outputs are regressed on the control about the newest control and with the newest covariance, not about
those that the step began with, which may lie far off. Prior, reference and P_err are the same in each pass, so
nothing is counted twice (iterated posterior linearisation: Garcia-Fernandez, Svensson, Morelande, Sarkka, 2015,
with the control in the place of the state). Where the outputs are linear in the control each pass finds the same.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.control import utc_step
from skydiver_utc.control.utc_memory import Memory, Rules

Array = NDArray[np.float64]


class IteratedUpdate:
    """A UTC step of several passes, as `skydiver_utc.control.utc.WholeStep`.

    A pass after the first that loses a point, or that has no finite answer, is not used, and is the last one: the
    control is then that of the pass before, and the points are told as lost. What the passes repair of Pu adds up.
    """

    def __init__(self, own: Memory, predict: Callable[..., None], iterations: int) -> None:
        self._own, self._predict, self._iterations = own, predict, iterations

    def __call__(
        self, rules: Rules, _block: Array, state: Array, preview: Array, reference: Array, Qu: Array
    ) -> tuple[int, int, int, float]:
        """Status, recovery, lost points and repair of Pu."""
        own = self._own
        applied = own.control.copy()
        repaired = utc_step.draw(rules, own)
        self._predict(state, applied, own.points, preview, own.outputs, own.saved)
        lost = utc_step.means(own)
        found = lost < len(own.points) and utc_step.covariances(own, Qu, own.next_control, own.next_predicted)
        if not found:
            return utc_step.settle(rules, own, False, utc_step.NONE, lost, repaired)
        prior, prior_covariance, _, _ = self._regressed()
        found = utc_step.update(own, reference)
        control, covariance = own.next_control.copy(), own.next_covariance - Qu
        predicted, innovation = own.next_predicted.copy(), own.innovation.copy()
        for _ in range(self._iterations - 1):
            if not found or lost:
                break
            own.control[:] = np.clip(control, own.minimum, own.maximum)
            own.covariance[:] = covariance
            repaired += utc_step.draw(rules, own)
            self._predict(state, applied, own.points, preview, own.outputs, own.saved)
            lost = utc_step.means(own)
            again = None if lost else self._posterior(prior, prior_covariance, reference)
            if again is None:
                break
            control, covariance = again
        own.control[:] = applied
        own.next_control[:], own.next_covariance[:] = control, covariance + Qu
        own.next_predicted[:], own.innovation[:] = predicted, innovation
        return utc_step.settle(rules, own, found, utc_step.NONE, lost, repaired)

    def _regressed(self) -> tuple[Array, Array, Array, Array]:
        """Mean (m,) and covariance (m, m) of U^i, the outputs' slope on them (l, m), what that leaves (l, l)."""
        own = self._own
        deviations, errors = own.saved - own.next_control, own.outputs - own.next_predicted
        weighted = own.left[:, None] * deviations
        covariance = weighted.T @ deviations
        slope = np.asarray(
            np.linalg.lstsq(covariance, weighted.T @ errors, rcond=None)[0].T, dtype=np.float64
        )
        left = errors.T @ (own.left[:, None] * errors) - slope @ covariance @ slope.T
        return own.next_control.copy(), covariance, slope, left

    def _posterior(
        self, prior: Array, prior_covariance: Array, reference: Array
    ) -> tuple[Array, Array] | None:
        """Control (m,) and covariance (m, m) from the prior and the newest regression; None if not finite."""
        own = self._own
        centre, _, slope, left = self._regressed()
        C_y = slope @ prior_covariance @ slope.T + left + own.P_err
        gain = np.linalg.lstsq(C_y, slope @ prior_covariance, rcond=None)[0].T
        control = prior + gain @ (reference - own.next_predicted - slope @ (prior - centre))
        covariance = prior_covariance - gain @ C_y @ gain.T
        if not (np.isfinite(control).all() and np.isfinite(covariance).all()):
            return None
        return control, covariance
