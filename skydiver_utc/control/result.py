"""What one step of the controller says about itself."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.control.protocol import Status
from skydiver_utc.control.utc_step import Recovery

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class UtcResult:
    """Result of one step.

    control (m,): finite and inside the bounds, whatever the status
    predicted, innovation (l,): mean output at the horizon and how far the reference is from it, one after the other
        for every step of the horizon at which outputs are taken; a step that keeps the previous control repeats the
        last prediction and has no innovation
    covariance (m, m): Pu after the step
    repaired: what had to be added to the eigenvalues of Pu before its root could be taken
    lost: how many of the 2m+1 sigma points diverged inside the horizon and were left out
    cause: the first error of plant, output or control dynamics by which a point diverged, "" where none raised one
    recovery: what was done where a negative W0, rounding or a failed step asked for more
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
    limited: tuple[str, ...]
    reason: str

    @property
    def deviations(self) -> Array:
        """Standard deviations (m,) of the controls."""
        deviations: Array = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        return deviations

    @property
    def sentence(self) -> str:
        """What happened, in words."""
        if self.status is Status.KEPT_PREVIOUS:
            again = (
                "; the next step begins from the initial Pu" if self.recovery is Recovery.RESTARTED else ""
            )
            return f"The previous control was kept: {self.reason}{again}."
        told = []
        if self.lost:
            what = "diverged and were left out"
            told.append(lost_in_words(self.lost, len(self.control), what, self.cause))
        if self.repaired > 0.0 and self.status is Status.REPAIRED:
            told.append(f"eigenvalues of Pu were lifted by {self.repaired:.3g} in all")
        if self.recovery is Recovery.ABOUT_CENTRE:
            told.append("W0 made the output's covariance indefinite, so it was taken about the central point")
        if self.recovery is Recovery.FACTORED:
            told.append(
                "rounding made the output's covariance indefinite, so it was factored from the deviations"
            )
        told.extend(self.limited)
        if not told:
            return f"Solved; the reference is {np.abs(self.innovation).max():.3g} from the predicted output."
        return f"{self.status.name.capitalize()}: {'; '.join(told)}."


def lost_in_words(lost: int, m: int, what: str, cause: str) -> str:
    """How many of the sigma points of m controls were lost, and by which error."""
    return f"{lost} of {2 * m + 1} sigma points {what}" + (f" ({cause})" if cause else "")


def limits_met(control: Array, before: Array, minimum: Array, maximum: Array, slew: Array) -> tuple[str, ...]:
    """In words, which controls (m,) ended on a bound or at their largest change from the control before."""
    told = []
    for j, value in enumerate(control):
        if value == minimum[j] or value == maximum[j]:
            told.append(f"control {j} is on its {'minimum' if value == minimum[j] else 'maximum'} {value:g}")
        elif value == before[j] - slew[j] or value == before[j] + slew[j]:
            told.append(f"control {j} is held by its rate limit")
    return tuple(told)
