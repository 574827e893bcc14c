# SPDX-License-Identifier: Apache-2.0
"""What the textbook plants are flown on: smooth moves of their outputs between constant values."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from textbook_plants import TextbookPlant

from skydiver_utc.arrays import Array

# From 0 to 1 with three derivatives of zero.
_SMOOTH = np.polynomial.Polynomial([0, 0, 0, 0, 35, -84, 70, -20])

Move = tuple[int, int, tuple[float, ...]]


class Task(NamedTuple):
    """What a plant is flown on: the outputs' moves from where they start, in units of the plant.

    span: size of the moves, by which errors are divided
    moves: (step at which it begins, its steps, outputs (l,))
    """

    span: float
    steps: int
    moves: tuple[Move, ...]


class Pair(NamedTuple):
    """The reference that a controller is tuned on, and the one that it is judged on."""

    tuned_on: Task
    judged_on: Task


TASKS: dict[str, Pair] = {
    "arm": Pair(
        Task(1.0, 150, ((10, 50, (1.0, -0.5)), (80, 30, (0.6, 0.0)))),
        Task(
            1.0,
            240,
            ((10, 45, (-0.8, 0.6)), (80, 50, (0.2, 0.2)), (130, 30, (-0.1, -0.2)), (160, 30, (0.3, 0.2))),
        ),
    ),
    "reactor": Pair(
        Task(0.2, 130, ((10, 20, (-0.2,)), (75, 15, (-0.05,)))),
        Task(0.2, 190, ((10, 15, (-0.215,)), (75, 15, (-0.05,)), (110, 15, (0.05,)), (125, 15, (-0.1,)))),
    ),
    "ship": Pair(
        Task(0.5, 160, ((10, 40, (0.5,)), (80, 50, (-0.3,)))),
        Task(0.5, 280, ((10, 35, (-0.4,)), (80, 50, (0.4,)), (170, 35, (0.1,)), (205, 35, (0.4,)))),
    ),
    "tanks": Pair(
        Task(2.0, 120, ((10, 20, (2.0, 0.0)), (65, 20, (0.0, 1.0)))),
        Task(2.0, 200, ((10, 20, (-1.5, 1.0)), (70, 20, (0.5, 1.0)), (120, 20, (1.0, -0.5)))),
    ),
    "cart_pole": Pair(
        Task(0.5, 250, ((20, 80, (0.5,)), (140, 80, (-0.2,)))),
        Task(0.5, 400, ((20, 75, (-0.6,)), (120, 80, (0.1,)), (220, 65, (-0.3,)), (285, 65, (0.1,)))),
    ),
    "late": Pair(
        Task(1.0, 150, ((10, 40, (1.0,)), (80, 40, (-0.2,)))),
        Task(1.0, 240, ((10, 35, (-0.8,)), (70, 45, (0.8,)), (130, 35, (0.3,)), (165, 35, (1.0,)))),
    ),
}


def reference(plant: TextbookPlant, moves: Sequence[Move], steps: int) -> Array:
    """What the outputs (steps, l) are to be: (T d/dt + 1)^p of the smooth moves."""
    T = plant.model.parameters.lead
    k = np.arange(steps)[:, None]
    start = plant.outputs(plant.initial_state()[None])[0] * np.ones((steps, 1))
    total, before = start.copy(), np.zeros(start.shape[1])
    for begin, length, to in moves:
        share = np.clip((k - begin) / length, 0.0, 1.0)
        for d in range(plant.about.order + 1):
            factor = math.comb(plant.about.order, d) * T**d / (length * plant.dt_s) ** d
            total += (np.array(to) - before) * factor * _SMOOTH.deriv(d)(share)
        before = np.array(to)
    return total
