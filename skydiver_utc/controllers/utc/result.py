# SPDX-License-Identifier: Apache-2.0
"""The result of one step of the controller."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.protocol import Status
from skydiver_utc.controllers.utc.law import Recovery
from skydiver_utc.controllers.utc.verdict import LARGE

# Pu counts as grown where its variance is above that at the start by this factor.
GROWN = 1e3


@dataclass(frozen=True, eq=False)
class UtcResult:
    """Result of one step.

    control (m,): finite and inside the bounds, whatever the status; before (m,): the one before
    predicted, innovation (l,): predicted output at the horizon and how far the reference is from it, for every step
        of the horizon at which outputs are taken; a step that keeps the previous control repeats the last prediction
        and has no innovation
    unit (l,): sqrt(P_err) of each
    of_control, mean_output (l,): output of the control before the step, NaN where it diverged, and the mean of the
        outputs of the sigma points; `innovation` of the settings says with which the reference is compared
    sigma_points (2m+1, m), outputs (2m+1, l): controls that were tried, the present one first, and their outputs
    gain (m, l): K, which turns the innovation into a change of the control
    covariance (m, m): Pu after the step; grown: the controls whose variance in it is too large
    repaired: the sum added to the eigenvalues of Pu before its root could be taken
    lost: how many of the 2m+1 sigma points diverged inside the horizon and were left out
    cause: the first error of plant, output or control dynamics by which a point diverged, "" where none raised one
    spread: the share of their usual distance at which the next points are drawn, below 1 after points diverged
    unmoved: names of outputs that no control moves inside the horizon
    recovery: the remedy after a negative W0, rounding or a failed step
    limits (3, m): minimum, maximum, largest change
    status, sentence: what happened, as a code and in words
    """

    control: Array
    predicted: Array
    innovation: Array
    unit: Array
    of_control: Array
    mean_output: Array
    sigma_points: Array
    outputs: Array
    gain: Array
    covariance: Array
    grown: tuple[str, ...]
    repaired: float
    lost: int
    cause: str
    spread: float
    unmoved: tuple[str, ...]
    recovery: Recovery
    status: Status
    before: Array
    limits: Array

    @property
    def normalised_innovation(self) -> Array:
        """The innovation (l,) in units of sqrt(P_err): beyond 3 the reference is not met as closely as P_err asks."""
        return self.innovation / self.unit

    @property
    def deviations(self) -> Array:
        """Standard deviations (m,) of the controls."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def limited(self) -> tuple[str, ...]:
        """In words, which controls ended on a bound, but for frozen ones, or at their largest change."""
        found = []
        for j, (value, before, low, high, change) in enumerate(
            zip(self.control, self.before, *self.limits, strict=True)
        ):
            if low < high and value in (low, high):
                found.append(f"control {j} is on its {'minimum' if value == low else 'maximum'} {value:g}")
            elif value in (before - change, before + change):
                found.append(f"control {j} is held by its rate limit")
        return tuple(found)

    @property
    def sentence(self) -> str:
        """The step in words."""
        if self.status is Status.KEPT_PREVIOUS:
            if self.recovery is Recovery.NONE:
                return "The previous control was kept: state or reference is not finite."
            reason = self._diverged if self.lost == len(self.sigma_points) else "the update is not finite"
            return f"The previous control was kept: {reason}; the next step begins from the initial Pu."
        parts = list(self._remarks())
        if self.status is Status.SOLVED and not parts:
            return f"Solved; {self._distance}."
        name = str(self.status).replace("_", " ").capitalize()
        return f"{name}: {'; '.join([*parts, self._distance])}."

    @property
    def _diverged(self) -> str:
        cause = f" ({self.cause})" if self.cause else ""
        return f"{self.lost} of {len(self.sigma_points)} sigma points diverged{cause}"

    @property
    def _distance(self) -> str:
        """The distance to the reference, in the output's unit, and in that of P_err where this is far."""
        far = np.abs(self.normalised_innovation).max()
        of_unit = f", {far:.3g} sqrt(P_err)," if far > LARGE else ""
        text = f"the reference is {np.abs(self.innovation).max():.3g}{of_unit} from the predicted output"
        apart = np.abs(self.of_control - self.mean_output)
        if (apart > self.unit).any():
            worst = int(np.argmax(apart / self.unit))
            text += f"; the output of the control itself is {apart[worst]:.3g} from the mean of the points"
        return text

    def _remarks(self) -> Iterator[str]:
        """Why the reference is not reached, what was repaired, where controls end, and which Pu grows."""
        if self.status is Status.NO_EFFECT:
            yield (
                f"no control moves {' or '.join(self.unmoved)} inside the horizon by what P_err lets count; take a"
                " longer horizon, a smaller P_err, or another output"
            )
        if self.status is Status.NOT_REACHED:
            yield "the predicted output has long been far from the reference, and hardly comes nearer"
        if self.lost:
            nearer = f", and the next are drawn at {self.spread:.3g} of their distance" * (self.spread < 1.0)
            yield f"{self._diverged} and were left out{nearer}"
        if self.repaired > 0.0 and self.status is Status.REPAIRED:
            yield f"eigenvalues of Pu were lifted by {self.repaired:.3g} in all"
        if self.recovery is Recovery.ABOUT_CENTRE:
            yield "W0 made the covariance of the outputs indefinite, so it was taken about the central point"
        if self.recovery is Recovery.OUTPUTS_REPAIRED:
            yield (
                "rounding made the covariance of the outputs indefinite, so its smallest eigenvalues were lifted"
            )
        yield from self.limited
        if self.grown:
            yield (
                f"Pu of {' and '.join(self.grown)} has grown too large: set forgetting_factor or nominal, or a"
                " smaller Qu"
            )
