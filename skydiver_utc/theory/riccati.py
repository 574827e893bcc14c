# SPDX-License-Identifier: Apache-2.0
"""The Riccati form of the stability condition, and its additional term for more than one prediction step.

A UTC step minimises du' Pu^-1 du + (r - y_N)' P_err^-1 (r - y_N). For a pair (F, G), a weight X and any gain L,

    X - (F - G L)' X (F - G L) = cost + effort - additional

    cost       = X - F'X F + F'X G (W + G'X G)^-1 G'X F,   W = Pu^-1
    effort     = L'W L
    additional = (L - L*)' (W + G'X G) (L - L*),   L* = (W + G'X G)^-1 G'X F

`cost` is the state cost for which X solves the discrete algebraic Riccati equation, L* the gain of one step. The
loop F - G L lets z'X z fall where the right side is positive. For one step L = L*, and nothing is added.
"""

from typing import NamedTuple

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.plants.linear import LinearModel
from skydiver_utc.theory.linear_plant import to_the_horizon
from skydiver_utc.theory.steady_gain import gain


class Riccati(NamedTuple):
    """The three terms (n, n); the condition is that cost + effort - additional is not negative."""

    cost: Array
    effort: Array
    additional: Array

    @property
    def margin(self) -> float:
        """Smallest eigenvalue of cost + effort - additional."""
        return float(np.linalg.eigvalsh(self.cost + self.effort - self.additional)[0])


def riccati_terms(F: Array, G: Array, X: Array, Pu: Array, L: Array) -> Riccati:
    """The terms for F (n, n), G (n, m), X (n, n), Pu (m, m) positive definite, L (m, n)."""
    W = np.linalg.inv(Pu)
    both = W + G.T @ X @ G
    best = np.linalg.solve(both, G.T @ X @ F)
    cost = X - F.T @ X @ F + F.T @ X @ G @ best
    return Riccati(cost, L.T @ W @ L, (L - best).T @ both @ (L - best))


def output_riccati(plant: LinearModel, Pu: Array, P_err: Array, steps: int) -> Riccati:
    """The terms for the output as measure, X = C' P_err^-1 C, and a control drawn around zero at each step."""
    F, H = to_the_horizon(plant, steps)
    X = plant.C.T @ np.linalg.solve(P_err, plant.C)
    return riccati_terms(plant.A, plant.B, X, Pu, gain(Pu, H, P_err) @ F)
