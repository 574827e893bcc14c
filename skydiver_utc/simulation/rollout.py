"""The roll-outs of Gauss-Newton and path-integral control on the skydiver: body rates of many sequences."""

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.control.horizon import Horizon
from skydiver_utc.jit import kernel
from skydiver_utc.plant.dynamics import STATE_SIZE, WORK_SIZE, rk4_step
from skydiver_utc.plant.model import PlantModel

Array = NDArray[np.float64]


class SkydiverRollOut:
    """See `skydiver_utc.control.horizon.RollOut`; the output is the body rate at `tracked` in the state."""

    def __init__(self, model: PlantModel, horizon: Horizon, tracked: int) -> None:
        self._model = model._replace(dt=model.dt * horizon.periods)
        self._hold = horizon.steps // horizon.blocks
        self._periods = horizon.periods
        self._tracked = tracked
        self._starts = np.empty((horizon.blocks, STATE_SIZE))
        self._work = np.empty(WORK_SIZE + STATE_SIZE + 4)

    def __call__(self, state: Array, applied: Array, sequences: Array, outputs: Array) -> None:
        roll_out(
            self._model, state, applied, sequences, self._hold, self._periods, self._tracked,
            outputs, self._starts, self._work,
        )  # fmt: skip


@kernel
def roll_out(
    model: PlantModel,
    state: Array,
    applied: Array,
    sequences: Array,
    hold: int,
    periods: int,
    tracked: int,
    outputs: Array,
    starts: Array,
    work: Array,
) -> None:
    """Body rates [rad/s] after each model step to outputs (S, N), of sequences (S, B, 4).

    A model step is `periods` control periods; over it alpha is held at the mean of what it takes in them, on its
    even way through the block of `hold` model steps. A sequence that begins with the blocks of the first one goes
    on from the states that the first one left in starts (B, 13).
    """
    x, control = work[:STATE_SIZE], work[STATE_SIZE : STATE_SIZE + 4]
    scratch = work[STATE_SIZE + 4 :]
    starts[0, :] = state
    for i in range(sequences.shape[0]):
        first = common_blocks(sequences[0], sequences[i]) if i > 0 else 0
        x[:] = starts[first]
        before = sequences[i, first - 1, 3] if first > 0 else applied[3]
        for j in range(first * hold):
            outputs[i, j] = outputs[0, j]
        for j in range(first * hold, outputs.shape[1]):
            b, inside = j // hold, j % hold
            if i == 0 and inside == 0:
                starts[b, :] = x
            share = (inside * periods + 0.5 * (periods + 1)) / (hold * periods)
            control[:] = sequences[i, b]
            control[3] = before + share * (sequences[i, b, 3] - before)
            if inside == hold - 1:
                before = sequences[i, b, 3]
            rk4_step(model, x, control, x, scratch)
            outputs[i, j] = x[tracked]


@kernel
def common_blocks(first: Array, other: Array) -> int:
    """How many blocks, short of the last, two sequences (B, m) have alike from the start."""
    last: int = first.shape[0] - 1
    for b in range(last):
        for c in range(first.shape[1]):
            if first[b, c] != other[b, c]:
                return b
    return last
