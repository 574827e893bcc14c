# SPDX-License-Identifier: Apache-2.0
"""Model predictive path-integral control (MPPI), for any plant.

Control sequences are drawn around the one at hand, limited, rolled out and averaged with the weights exp(-J/lambda)
(Williams, Drews, Goldfain, Rehg, Theodorou, IEEE Trans. Robotics 34 (2018) 1603-1622). J (`controllers/horizon.py`)
holds the cost on the control explicitly in the place of that paper's likelihood ratio. Limits are convex and every
sample keeps them, so their mean keeps them, too.
"""

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.horizon import SequenceController
from skydiver_utc.controllers.limits import by_name
from skydiver_utc.controllers.protocol import Decision, Status
from skydiver_utc.controllers.settings import MppiSettings
from skydiver_utc.plants.protocol import Plant

_SHARE = 0.1


class PathIntegralController(SequenceController):
    """Keeps a control sequence and a random generator; a reset starts both anew, so runs repeat bit for bit."""

    telemetry_names: tuple[str, ...] = ("predicted_error", "cost", "effective_samples")

    def __init__(
        self, settings: MppiSettings, plant: Plant, outputs: tuple[str, ...], dt_s: float, seed: int = 0
    ) -> None:
        super().__init__(settings, plant, outputs, settings.samples)
        self._deviation = by_name("deviation", settings.deviation, plant, _SHARE) * (
            plant.maximum - plant.minimum
        )
        self._temperature, self._seed = settings.temperature, seed
        self.reset()

    def resume(self, control: Array) -> None:
        """Start from this control, the one applied last, held over the horizon, and from the seed."""
        self._generator = np.random.default_rng(self._seed)
        super().resume(control)

    def decide(self, state: Array, preview: Array) -> Decision:
        """Draw, roll out, average; the first sample is the sequence at hand."""
        at = self._horizon
        reference = np.ascontiguousarray(at.reference(preview))
        self._draw()
        outputs = at.outputs(state, self._previous, preview)
        with np.errstate(over="ignore", invalid="ignore"):
            costs = self._cost.of(at.sequences, self._previous, outputs, reference)
            costs[~np.isfinite(costs)] = np.inf
            least = costs.min()
            if not least < np.inf:
                return self._kept()
            weights = np.exp((least - costs) / self._temperature)
        weights /= weights.sum()
        solution = np.einsum("s,sbc->bc", weights, at.sequences)
        last = outputs[weights > 0.0, -reference.shape[1] :]
        error = float(np.hypot.reduce(reference[-1] - weights[weights > 0.0] @ last, initial=0.0))
        control = at.first_period(solution, self._previous)
        at_limit = (control == at.limits[0]) | (control == at.limits[1])
        self._previous = control
        self._sequence = at.one_period_on(solution)
        telemetry = np.array([error, least, 1.0 / float(weights @ weights)])
        return Decision(control.copy(), telemetry, Status.SATURATED if at_limit.any() else Status.SOLVED)

    def _draw(self) -> None:
        """Sequences (S, B, m) around the one at hand, within bounds and rates."""
        at = self._horizon
        minimum, maximum, change = at.limits
        drawn = self._deviation * self._generator.standard_normal(at.sequences.shape)
        drawn[0] = 0.0
        before = np.broadcast_to(self._previous, drawn[:, 0].shape)
        allowed = change * at.block_periods
        for b in range(at.blocks):
            wanted = self._sequence[b] + drawn[:, b]
            lower, upper = np.maximum(minimum, before - allowed), np.minimum(maximum, before + allowed)
            at.sequences[:, b] = before = np.minimum(np.maximum(wanted, lower), upper)
