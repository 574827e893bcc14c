# SPDX-License-Identifier: Apache-2.0
"""One step of plain UTC for any plant, as a textbook would write it: NumPy, one sigma point at a time.

Equations are those of section 3 of the paper under its labels. Never imports the code under test.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Problem(NamedTuple):
    """What does not change from step to step. `steps`: where on the horizon outputs are taken."""

    plant: Callable[[Array, Array, float], Array]
    output: Callable[[Array], Array]
    dt: float
    steps: tuple[int, ...]
    low: Array
    high: Array
    largest_change: Array
    P_err: Array  # for all outputs at all steps together
    W0: float
    floor: float
    dynamics: Callable[[Array, Array, Array, Array, int], Array] | None = None
    drawn: tuple[int, ...] = ()  # controls that are outputs themselves; P_err holds their variances last
    rest: tuple[float, ...] = ()  # and their reference


def root(P: Array, floor: float) -> Array:
    """The symmetric root of P, its eigenvalues raised to the floor first."""
    values, vectors = np.linalg.eigh(0.5 * (P + P.T))
    return vectors @ np.diag(np.sqrt(np.maximum(values, floor))) @ vectors.T


def limit(u: Array, before: Array, p: Problem) -> Array:
    """Magnitude first, then the change."""
    return np.clip(np.clip(u, p.low, p.high), before - p.largest_change, before + p.largest_change)


def to_the_horizon(point: Array, applied: Array, x: Array, preview: Array, p: Problem) -> tuple[Array, Array]:
    """The outputs at the steps wanted, and the control that stands for the point."""
    u, saved, outputs = applied, point, []
    for j in range(max(p.steps)):
        u = limit(point if p.dynamics is None else p.dynamics(point, u, x, preview, j), u, p)
        if p.dynamics is not None and j == 0:
            saved = u
        x = p.plant(x, u, p.dt)
        if j + 1 in p.steps:
            outputs.append(np.atleast_1d(p.output(x)))
    return np.concatenate(outputs), saved


def step(U: Array, Pu: Array, x: Array, preview: Array, Qu: Array, p: Problem) -> tuple[Array, Array, Array]:
    """U and Pu after the step, and the mean output; row j of the preview is wanted j steps from now."""
    m = len(U)
    S = np.sqrt(m / (1 - p.W0)) * root(Pu, p.floor)
    drawn = [U] + [U + S[:, j] for j in range(m)] + [U - S[:, j] for j in range(m)]  # eq:sigp
    W = np.array([p.W0] + [(1 - p.W0) / (2 * m)] * (2 * m))
    points = []
    for point in drawn:
        moved = point.copy()
        for j in range(m):
            if (U[j] == p.low[j] and point[j] < p.low[j]) or (U[j] == p.high[j] and point[j] > p.high[j]):
                moved[j] = 1.5 * U[j] - 0.5 * point[j]  # eq:movep
        points.append(np.clip(moved, p.low, p.high))  # eq:minmax_utc
    runs = [to_the_horizon(point, U, x, preview, p) for point in points]
    saved = np.array([run[1] for run in runs])
    Y = np.array([np.concatenate([run[0], run[1][list(p.drawn)]]) for run in runs])
    U_pred, Y_pred = W @ saved, W @ Y  # eq:xpred, eq:zpred
    dU, dY = saved - U_pred, Y - Y_pred
    C_y = p.P_err + dY.T @ np.diag(W) @ dY
    C_uy = dU.T @ np.diag(W) @ dY
    K = C_uy @ np.linalg.inv(C_y)  # eq:utc_controller
    wanted = np.concatenate([*(preview[j] for j in p.steps), p.rest])
    Pu_next = Qu + dU.T @ np.diag(W) @ dU - K @ C_y @ K.T  # eq:pu_pred
    return limit(U_pred + K @ (wanted - Y_pred), U, p), Pu_next, Y_pred
