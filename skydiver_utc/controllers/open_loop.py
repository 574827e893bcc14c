# SPDX-License-Identifier: Apache-2.0
"""Open loop: controls follow the reference, without feedback."""

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.limits import LimitedController, limit
from skydiver_utc.controllers.protocol import Decision, Status
from skydiver_utc.controllers.settings import OpenLoopSettings
from skydiver_utc.plants.protocol import Plant


class OpenLoop(LimitedController):
    """Controls named by the reference follow it; the others keep their initial values."""

    preview_steps = 0

    def __init__(
        self, settings: OpenLoopSettings, plant: Plant, outputs: tuple[str, ...], dt_s: float, seed: int = 0
    ) -> None:
        if unknown := set(outputs) - set(plant.control_names):
            raise ValueError(
                f"the reference must be for controls of the plant, not for {', '.join(sorted(unknown))}"
            )
        self._driven = [plant.control_names.index(name) for name in outputs]
        self.telemetry_names: tuple[str, ...] = tuple(f"{name}_unlimited" for name in outputs)
        super().__init__(plant)

    def decide(self, state: Array, preview: Array) -> Decision:
        """The reference, bounded and slewed."""
        wanted = self._initial.copy()
        wanted[self._driven] = preview[0]
        limit(wanted, self._limits, self._previous)
        status = Status.SOLVED if (self._previous == wanted).all() else Status.SATURATED
        return Decision(self._previous.copy(), preview[0].copy(), status)
