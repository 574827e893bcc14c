# SPDX-License-Identifier: Apache-2.0
"""The bound of the closed loop under a bounded nonlinearity z+ = Z z + d, |d| <= D (after arXiv 2504.08579).

With P = I + Z'P Z (discrete Lyapunov equation), V = z'P z falls wherever

    |z| > R = D (|Z| p_max + sqrt(|Z|^2 p_max^2 + p_max)),    p_max the largest eigenvalue of P.

The ball R alone is not kept: inside it V may rise, and a step may lead out of it. The level set V <= p_max R^2
is kept, and with it the ball of R sqrt(p_max / p_min). From rest, the sum of |Z^k| D is a bound of its own.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_discrete_lyapunov

from skydiver_utc.arrays import Array

_MOST_TERMS = 1_000_000


class Ball(NamedTuple):
    """radius R: V falls outside; kept: never left from within V <= p_max R^2; summed: never left from rest."""

    radius: float
    kept: float
    summed: float


def ball(Z: Array, D: float) -> Ball:
    """The radii for a stable Z (p, p); raises `ValueError` where Z is not stable."""
    if not np.abs(np.linalg.eigvals(Z)).max() < 1.0:
        raise ValueError("the closed loop is not stable: no bound holds")
    P = np.asarray(solve_discrete_lyapunov(Z.T, np.eye(len(Z))), dtype=float)
    values = np.linalg.eigvalsh(P)
    p_min, p_max = float(values[0]), float(values[-1])
    size = float(np.linalg.norm(Z, 2))
    R = D * (size * p_max + np.sqrt(size**2 * p_max**2 + p_max))
    return Ball(R, R * float(np.sqrt(p_max / p_min)), D * _sum_of_norms(Z))


def _sum_of_norms(Z: Array) -> float:
    """Sum of |Z^k| over k >= 0."""
    total, power = 0.0, np.eye(len(Z))
    for _ in range(_MOST_TERMS):
        size = float(np.linalg.norm(power, 2))
        total += size
        if size < 1e-13 * total:
            break
        power = power @ Z
    return total
