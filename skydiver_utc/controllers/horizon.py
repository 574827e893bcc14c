# SPDX-License-Identifier: Apache-2.0
"""The horizon's grid, control sequence and cost, shared by Gauss-Newton and path-integral control.

The horizon has N model steps of `periods` control periods each, cut into B blocks of equal length. A control
sequence (B, m) holds one control per block. A control without a rate limit jumps at the start of its block and is
held; one with a rate limit moves evenly over the block and is there at its end, so that the rate limit bounds the
difference of two neighbours. With y_j the outputs after j model steps and r_j their reference, both minimise

    J = 1/N sum_j |y_j - r_j|^2 + 1/B sum_b sum_c w_c (U_b,c - rest_c)^2 + 1/B sum_b sum_c s_c (U_b,c - U_b-1,c)^2

where U_-1 is the control applied last.
"""

from typing import NamedTuple

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.limits import LimitedController, by_name, limited, limits_of
from skydiver_utc.controllers.protocol import Decision, Status
from skydiver_utc.controllers.roll_out import Dynamics, RollOut
from skydiver_utc.controllers.settings import CostSettings, HorizonSettings
from skydiver_utc.jit import program
from skydiver_utc.plants.protocol import Plant

_COST, _CHANGE_COST = 0.1, 1.0


class HorizonCost(NamedTuple):
    """w (m,) on the distance from nominal (m,), s (m,) on changes from block to block."""

    control: Array
    change: Array
    nominal: Array

    def of(self, sequences: Array, applied: Array, outputs: Array, reference: Array) -> Array:
        """J (S,) of sequences (S, B, m) with their outputs (S, N l); NaN where an output is."""
        steps, blocks = reference.shape[0], sequences.shape[1]
        changes = sequences.copy()
        changes[:, 0] -= applied
        changes[:, 1:] -= sequences[:, :-1]
        tracking = np.sum((outputs - reference.ravel()) ** 2, axis=1)
        effort = np.sum((sequences - self.nominal) ** 2 @ self.control + changes**2 @ self.change, axis=1)
        return tracking / steps + effort / blocks


def cost_of(settings: CostSettings, plant: Plant) -> HorizonCost:
    """Costs for the whole range turned into costs per unit of each control."""
    squared_range = (plant.maximum - plant.minimum) ** 2
    return HorizonCost(
        control=by_name("cost", settings.cost, plant, _COST) / squared_range,
        change=by_name("change_cost", settings.change_cost, plant, _CHANGE_COST) / squared_range,
        nominal=by_name("nominal", settings.nominal, plant, plant.initial_control()),
    )


class Horizon:
    """The roll-out of a number of control sequences (S, B, m), `sequences`, over the horizon of a plant."""

    def __init__(self, settings: HorizonSettings, plant: Plant, outputs: tuple[str, ...], count: int) -> None:
        m, blocks = len(plant.control_names), settings.blocks
        self.blocks, self.limits = blocks, limits_of(plant)
        self.hold = settings.horizon_steps // blocks
        self._periods = settings.step_periods
        self.block_periods = self.hold * self._periods
        self.preview_steps = settings.preview_steps(plant.dt_s)
        self._moving = np.isfinite(self.limits[2])
        self._numbers = np.array([self.hold, self._periods, *self._moving, *np.zeros(m)], dtype=float)
        model = plant.model if self._periods == 1 else plant.model_of_step(self._periods * plant.dt_s)
        selected = [plant.output_names.index(name) for name in outputs]
        unlimited = np.array([np.full(m, -np.inf), np.full(m, np.inf), np.full(m, np.inf)])
        self._roll_out = RollOut(
            model, len(plant.output_names), range(1, settings.horizon_steps + 1), selected, unlimited,
            (count, blocks * m), Dynamics(in_blocks, self._numbers, False),
        )  # fmt: skip
        self.sequences = self._roll_out.points.reshape(count, blocks, m)
        # The blocks that a sequence has in common with the first one are not computed again.
        self.begin = self._roll_out.begin

    def outputs(self, state: Array, applied: Array, preview: Array) -> Array:
        """Outputs (S, N l) of the sequences from a state, with the control applied last."""
        self._numbers[2 + len(applied) :] = applied
        self._roll_out(state, applied, preview)
        return self._roll_out.outputs

    def reference(self, preview: Array) -> Array:
        """r_1 .. r_N, shape (N, l), from a preview by control periods that starts now."""
        return preview[self._periods : self.preview_steps + 1 : self._periods]

    def first_period(self, sequence: Array, applied: Array) -> Array:
        """The control (m,) of a sequence's first control period."""
        first = sequence[0]
        moved = applied + (first - applied) / self.block_periods
        return limited(np.where(self._moving, moved, first), applied, self.limits)

    def one_period_on(self, sequence: Array) -> Array:
        """The sequence (B, m) as seen one control period later, the last block held on."""
        moved = sequence.copy()
        moved[:-1] += (sequence[1:] - sequence[:-1]) / self.block_periods
        return moved


class SequenceController(LimitedController):
    """A controller that keeps a control sequence (B, m) besides the control applied last."""

    telemetry_names: tuple[str, ...]

    def __init__(self, settings: HorizonSettings, plant: Plant, outputs: tuple[str, ...], count: int) -> None:
        """count: how many sequences a decision rolls out."""
        super().__init__(plant)
        self._horizon, self._cost = Horizon(settings, plant, outputs, count), cost_of(settings, plant)
        self.preview_steps = self._horizon.preview_steps

    def resume(self, control: Array) -> None:
        """Start from this control (m,), the one applied last, held over the horizon."""
        super().resume(control)
        self._sequence = np.tile(control, (self._horizon.blocks, 1))

    def _kept(self) -> Decision:
        """The control applied last; the sequence led where the model has no finite answer, and begins anew from it."""
        self._sequence = np.tile(self._previous, (self._horizon.blocks, 1))
        return Decision(self._previous.copy(), np.zeros(len(self.telemetry_names)), Status.KEPT_PREVIOUS)


@program
def in_blocks(
    point: Array,
    before: Array,
    state: Array,
    y: Array,
    y_before: Array,
    preview: Array,
    j: int,
    numbers: Array,
    out: Array,
) -> None:
    """A control sequence (B m,) inside the horizon; numbers: hold, periods, moving (m,), control applied last (m,).

    A model step is `periods` control periods; over it a moving control is held at the mean of what it takes in them,
    on its even way through the block of `hold` model steps.
    """
    m, hold, periods = out.shape[0], int(numbers[0]), numbers[1]
    block, inside = j // hold, j % hold
    share = (inside * periods + 0.5 * (periods + 1)) / (hold * periods)
    for c in range(m):
        out[c] = point[block * m + c]
        if numbers[2 + c] > 0.0:
            start = point[(block - 1) * m + c] if block > 0 else numbers[2 + m + c]
            out[c] = start + share * (out[c] - start)
