# SPDX-License-Identifier: Apache-2.0
"""The result of one step of the controller."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.controllers.protocol import Status
from skydiver_utc.controllers.utc.law import Recovery

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class UtcResult:
    """Result of one step.

    control (m,): finite and inside the bounds, whatever the status; before (m,): the one before
    predicted, innovation (l,): mean output at the horizon and how far the reference is from it, for every step of the
        horizon at which outputs are taken; a step that keeps the previous control repeats the last prediction and has
        no innovation
    covariance (m, m): Pu after the step
    repaired: the sum added to the eigenvalues of Pu before its root could be taken
    lost: how many of the 2m+1 sigma points diverged inside the horizon and were left out
    cause: the first error of plant, output or control dynamics by which a point diverged, "" where none raised one
    recovery: the remedy after a negative W0, rounding or a failed step
    limits (3, m): minimum, maximum, largest change
    status, sentence: what happened, as a code and in words
    """

    control: Array
    predicted: Array
    innovation: Array
    covariance: Array
    repaired: float
    lost: int
    cause: str
    recovery: Recovery
    status: Status
    before: Array
    limits: Array

    @property
    def deviations(self) -> Array:
        """Standard deviations (m,) of the controls."""
        deviations: Array = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        return deviations

    @property
    def limited(self) -> tuple[str, ...]:
        """In words, which controls ended on a bound or at their largest change."""
        minimum, maximum, slew = self.limits
        found = []
        for j, value in enumerate(self.control):
            if value in (minimum[j], maximum[j]):
                found.append(
                    f"control {j} is on its {'minimum' if value == minimum[j] else 'maximum'} {value:g}"
                )
            elif value in (self.before[j] - slew[j], self.before[j] + slew[j]):
                found.append(f"control {j} is held by its rate limit")
        return tuple(found)

    @property
    def sentence(self) -> str:
        """What happened, in words."""
        points = 2 * len(self.control) + 1
        diverged = f"{self.lost} of {points} sigma points diverged" + (
            f" ({self.cause})" if self.cause else ""
        )
        if self.status is Status.KEPT_PREVIOUS:
            if self.recovery is Recovery.NONE:
                return "The previous control was kept: state or reference is not finite."
            reason = diverged if self.lost == points else "the update is not finite"
            return f"The previous control was kept: {reason}; the next step begins from the initial Pu."
        parts = [f"{diverged} and were left out"] if self.lost else []
        if self.repaired > 0.0 and self.status is Status.REPAIRED:
            parts.append(f"eigenvalues of Pu were lifted by {self.repaired:.3g} in all")
        if self.recovery is Recovery.ABOUT_CENTRE:
            parts.append(
                "W0 made the covariance of the outputs indefinite, so it was taken about the central point"
            )
        if self.recovery is Recovery.OUTPUTS_REPAIRED:
            parts.append(
                "rounding made the covariance of the outputs indefinite, so its smallest eigenvalues were lifted"
            )
        parts.extend(self.limited)
        if not parts:
            return f"Solved; the reference is {np.abs(self.innovation).max():.3g} from the predicted output."
        return f"{self.status.name.capitalize()}: {'; '.join(parts)}."
