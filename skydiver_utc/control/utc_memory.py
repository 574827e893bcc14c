"""The arrays of one UTC, all in one block: to hand each of them to a kernel would cost more than the update."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.jit import kernel

Array = NDArray[np.float64]


class Rules(NamedTuple):
    """Numbers that do not change from step to step: see `skydiver_utc.control.utc.UtcLaw`.

    m controls and l `outputs`; `kept_share` is the share of Pu that is not forgotten.
    """

    m: int
    outputs: int
    W0: float
    floor: float
    kept_share: float
    keep_indefinite: bool
    move_unclipped: bool
    square_root: bool


class Memory(NamedTuple):
    """What stays, what lasts from step to step, what a prediction reads and writes, and scratch.

    Constant: minimum, maximum, slew (m,); P_err and its Cholesky factor (l, l); weights (2m+1,) of the controls and
    of the mean output.
    Lasting: control (m,), covariance (m, m) with a factor (m, m), deviations (m,), predicted (l,).
    points (2m+1, m) go into a prediction; outputs (2m+1, l) and saved (2m+1, m) come out of it.
    """

    minimum: Array
    maximum: Array
    slew: Array
    P_err: Array
    P_err_factor: Array
    weights: Array
    output_weights: Array
    control: Array
    covariance: Array
    factor: Array
    deviations: Array
    predicted: Array
    points: Array
    outputs: Array
    saved: Array
    innovation: Array
    left: Array
    output_left: Array
    root: Array
    values: Array
    vectors: Array
    rows: Array
    next_control: Array
    next_covariance: Array
    next_predicted: Array
    output_factor: Array
    gain: Array
    array: Array
    vector: Array


def new_block(m: int, outputs: int) -> Array:
    """Room for `memory`: as many arrays as it has, each as large as the largest."""
    size = outputs + m
    return np.zeros(len(Memory._fields) * size * (2 * m + 1 + size))


@kernel
def memory(block: Array, m: int, outputs: int) -> Memory:
    """The block's arrays as views of it, in the order of the fields."""
    count, size = 2 * m + 1, outputs + m
    minimum, at = _row(block, 0, m)
    maximum, at = _row(block, at, m)
    slew, at = _row(block, at, m)
    P_err, at = _matrix(block, at, outputs, outputs)
    P_err_factor, at = _matrix(block, at, outputs, outputs)
    weights, at = _row(block, at, count)
    output_weights, at = _row(block, at, count)
    control, at = _row(block, at, m)
    covariance, at = _matrix(block, at, m, m)
    factor, at = _matrix(block, at, m, m)
    deviations, at = _row(block, at, m)
    predicted, at = _row(block, at, outputs)
    points, at = _matrix(block, at, count, m)
    given, at = _matrix(block, at, count, outputs)
    saved, at = _matrix(block, at, count, m)
    innovation, at = _row(block, at, outputs)
    left, at = _row(block, at, count)
    output_left, at = _row(block, at, count)
    root, at = _matrix(block, at, m, m)
    values, at = _row(block, at, m)
    vectors, at = _matrix(block, at, m, m)
    rows, at = _matrix(block, at, m, m)
    next_control, at = _row(block, at, m)
    next_covariance, at = _matrix(block, at, m, m)
    next_predicted, at = _row(block, at, outputs)
    output_factor, at = _matrix(block, at, outputs, outputs)
    gain, at = _matrix(block, at, m, outputs)
    array, at = _matrix(block, at, size, count + size)
    vector, at = _row(block, at, size)
    return Memory(
        minimum, maximum, slew, P_err, P_err_factor, weights, output_weights, control, covariance, factor,
        deviations, predicted, points, given, saved, innovation, left, output_left, root, values, vectors, rows,
        next_control, next_covariance, next_predicted, output_factor, gain, array, vector,
    )  # fmt: skip


@kernel
def _row(block: Array, at: int, size: int) -> tuple[Array, int]:
    return block[at : at + size], at + size


@kernel
def _matrix(block: Array, at: int, rows: int, columns: int) -> tuple[Array, int]:
    end = at + rows * columns
    return block[at:end].reshape((rows, columns)), end
