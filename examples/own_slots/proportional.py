# SPDX-License-Identifier: Apache-2.0
"""A controller of one's own: one control in proportion to the error of one output."""

from typing import Annotated

import numpy as np

from skydiver_utc import Decision, Plant, SlotSettings, Status, quantity


class Proportional:
    """control = gain (reference - output); all other controls stay where they start."""

    class Settings(SlotSettings):
        """Which control, and how strongly."""

        control: str
        gain: Annotated[float, quantity("control per output", "gain", ge=0)] = 1.0

    preview_steps = 0
    telemetry_names = ("error",)

    def __init__(
        self, settings: Settings, plant: Plant, outputs: tuple[str, ...], dt_s: float, seed: int
    ) -> None:
        self._plant, self._gain = plant, settings.gain
        self._output = plant.output_names.index(outputs[0])
        self._index = plant.control_names.index(settings.control)

    def reset(self) -> None:
        """Nothing is kept from step to step."""

    def resume(self, control: np.ndarray) -> None:
        """Nothing to continue."""

    def decide(self, state: np.ndarray, preview: np.ndarray) -> Decision:
        """The control for the state (n,) and the reference (1, l) at this step."""
        error = preview[0, 0] - self._plant.outputs(state)[self._output]
        control = self._plant.initial_control()
        control[self._index] = self._gain * error
        return Decision(control, np.array([error]), Status.SOLVED)
