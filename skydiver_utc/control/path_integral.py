"""Model predictive path-integral control (MPPI), for any plant given as a roll-out.

Control sequences are drawn around the one at hand, limited, rolled out and averaged with the weights exp(-J/lambda)
(Williams, Drews, Goldfain, Rehg, Theodorou, IEEE Trans. Robotics 34 (2018) 1603-1622). J (`control/horizon.py`)
holds the cost on the control explicitly in the place of that paper's likelihood ratio. Limits are convex and every
sample keeps them, so their mean keeps them, too.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.control.horizon import (
    Horizon,
    HorizonCost,
    RollOut,
    cost_of,
    first_period,
    one_period_on,
)
from skydiver_utc.control.limits import ControlLimits
from skydiver_utc.control.protocol import Decision, Status
from skydiver_utc.jit import kernel

Array = NDArray[np.float64]


class Sampling(NamedTuple):
    """Number of samples, standard deviation (m,) of each control, temperature lambda of the weights, seed."""

    samples: int
    deviation: Array
    temperature: float
    seed: int


class PathIntegralController:
    """Keeps a control sequence and a random generator; a reset starts both anew, so flights repeat bit for bit."""

    telemetry_names: tuple[str, ...] = ("predicted_output", "predicted_error", "cost", "effective_samples")

    def __init__(
        self,
        roll_out: RollOut,
        limits: ControlLimits,
        horizon: Horizon,
        cost: HorizonCost,
        sampling: Sampling,
        initial: Array,
    ) -> None:
        m = len(initial)
        self._roll_out, self._limits, self._horizon, self._cost = roll_out, limits, horizon, cost
        self._sampling, self._initial = sampling, initial
        self._allowed = limits.slew * horizon.block_periods
        self._candidates = np.empty((sampling.samples, horizon.blocks, m))
        self._outputs = np.empty((sampling.samples, horizon.steps))
        self._weights = np.empty(sampling.samples)
        self.preview_steps = horizon.preview_steps
        self.reset()

    def reset(self) -> None:
        """Start again from the initial control and the seed."""
        self.resume(self._initial)

    def resume(self, control: Array) -> None:
        """Start from this control, the one applied last, held over the horizon, and from the seed."""
        self._generator = np.random.default_rng(self._sampling.seed)
        self._applied = control.copy()
        self._sequence = np.tile(control, (self._horizon.blocks, 1))

    def decide(self, state: Array, preview: Array) -> Decision:
        """Draw, roll out, average; the first sample is the sequence at hand."""
        reference = self._horizon.reference(preview)
        self._generator.standard_normal(out=self._candidates)
        place_samples(
            self._sequence, self._applied, self._sampling.deviation, self._allowed,
            self._limits.minimum, self._limits.maximum, self._candidates,
        )  # fmt: skip
        self._roll_out(state, self._applied, self._candidates, self._outputs)
        solution = np.zeros_like(self._sequence)
        least, effective = average(
            self._candidates, self._outputs, reference, self._applied, self._cost,
            self._sampling.temperature, self._weights, solution,
        )  # fmt: skip
        if not effective > 0.0:
            self._sequence = np.tile(self._applied, (self._horizon.blocks, 1))
            return Decision(self._applied.copy(), np.zeros(len(self.telemetry_names)), Status.KEPT_PREVIOUS)
        predicted = float(self._weights @ self._outputs[:, -1])
        control = first_period(solution, self._applied, self._limits, self._horizon)
        at_limit = (control == self._limits.minimum) | (control == self._limits.maximum)
        self._applied = control
        self._sequence = one_period_on(solution, self._horizon)
        telemetry = np.array([predicted, float(reference[-1]) - predicted, least, effective])
        return Decision(control.copy(), telemetry, Status.SATURATED if at_limit.any() else Status.SOLVED)


@kernel
def place_samples(
    sequence: Array,
    applied: Array,
    deviation: Array,
    allowed: Array,
    minimum: Array,
    maximum: Array,
    candidates: Array,
) -> None:
    """Turn standard normal numbers (S, B, m) into sequences around one (B, m), within bounds and rates."""
    for i in range(candidates.shape[0]):
        for b in range(candidates.shape[1]):
            for c in range(candidates.shape[2]):
                before = candidates[i, b - 1, c] if b > 0 else applied[c]
                drawn = deviation[c] * candidates[i, b, c] if i > 0 else 0.0
                lower = max(minimum[c], before - allowed[c])
                upper = min(maximum[c], before + allowed[c])
                candidates[i, b, c] = min(max(sequence[b, c] + drawn, lower), upper)


@kernel
def average(
    candidates: Array,
    outputs: Array,
    reference: Array,
    applied: Array,
    cost: HorizonCost,
    temperature: float,
    weights: Array,
    solution: Array,
) -> tuple[float, float]:
    """Add the weighted mean of the samples to solution (B, m) and leave the weights, which sum to one.

    Returns the least cost and the effective number of samples 1 / sum w^2, 0 if no sample has a finite cost. A
    sample without one has the weight zero, and its outputs are set to zero.
    """
    least = np.inf
    for i in range(candidates.shape[0]):
        weights[i] = cost_of(candidates[i], applied, outputs[i], reference, cost)
        if weights[i] < least:
            least = weights[i]
    if not least < np.inf:
        return 0.0, 0.0
    total = 0.0
    for i in range(candidates.shape[0]):
        if weights[i] < np.inf:
            weights[i] = np.exp((least - weights[i]) / temperature)
        else:
            weights[i] = 0.0
            outputs[i, :] = 0.0
        total += weights[i]
    squares = 0.0
    for i in range(candidates.shape[0]):
        weights[i] /= total
        squares += weights[i] * weights[i]
        for b in range(candidates.shape[1]):
            for c in range(candidates.shape[2]):
                solution[b, c] += weights[i] * candidates[i, b, c]
    return least, 1.0 / squares
