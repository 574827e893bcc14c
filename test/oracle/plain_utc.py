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


def sigma_points(U: Array, P: Array, W0: float, floor: float = 0.0) -> Array:
    """eq:sigp, (2m+1, m): U, U + sqrt(m / (1 - W0)) S_j, then U - ...; S S = P, its eigenvalues raised to the floor.

    The paper does not define n of its root: n = m, with which the points reproduce P.
    """
    values, vectors = np.linalg.eigh(0.5 * (P + P.T))
    S = vectors @ np.diag(np.sqrt(np.maximum(values, floor))) @ vectors.T
    offsets = np.sqrt(len(U) / (1.0 - W0)) * S
    return np.vstack([[U], U + offsets, U - offsets])


def weights(m: int, W0: float) -> Array:
    """eq:sigp: W0, then 2m of (1 - W0) / (2m)."""
    return np.array([W0] + [(1.0 - W0) / (2.0 * m)] * (2 * m))


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


def predict(points: Array, W: Array, Qu: Array) -> tuple[Array, Array]:
    """U_k+1/k (eq:xpred) and Pu_k+1/k (eq:pu_pred) of the saved points."""
    dU = points - W @ points
    return W @ points, Qu + dU.T @ np.diag(W) @ dU


class Updated(NamedTuple):
    U: Array  # of `update` before bounds and slew rate, of `step` after both
    Pu: Array  # neither repaired nor symmetrised
    Ypred: Array


def update(U: Array, Pu: Array, points: Array, Y: Array, W: Array, wanted: Array, P_err: Array) -> Updated:
    """eq:zpred and eq:utc_controller of what `predict` gives, for any number of outputs Y (2m+1, l)."""
    Ypred = W @ Y
    dY, dU = Y - Ypred, points - U
    C_y = P_err + dY.T @ np.diag(W) @ dY
    K = dU.T @ np.diag(W) @ dY @ np.linalg.inv(C_y)
    return Updated(U + K @ (wanted - Ypred), Pu - K @ C_y @ K.T, Ypred)


def bounded(point: Array, U: Array, p: Problem) -> Array:
    """eq:movep, where the mean itself lies on the bound that the point passes; then eq:minmax_utc."""
    beyond = ((p.low == U) & (point < p.low)) | ((p.high == U) & (point > p.high))
    return np.clip(np.where(beyond, 1.5 * U - 0.5 * point, point), p.low, p.high)


def step(U: Array, Pu: Array, x: Array, preview: Array, Qu: Array, p: Problem) -> Updated:
    """U and Pu after the step, and the mean output; row j of the preview is wanted j steps from now."""
    points = [bounded(point, U, p) for point in sigma_points(U, Pu, p.W0, p.floor)]
    runs = [to_the_horizon(point, U, x, preview, p) for point in points]
    saved = np.array([run[1] for run in runs])
    Y = np.array([np.concatenate([run[0], run[1][list(p.drawn)]]) for run in runs])
    wanted, W = np.concatenate([*(preview[j] for j in p.steps), p.rest]), weights(len(U), p.W0)
    found = update(*predict(saved, W, Qu), saved, Y, W, wanted, p.P_err)
    return found._replace(U=limit(found.U, U, p))
