# SPDX-License-Identifier: Apache-2.0
"""The results of the theory, which docs/theory.md derives, for one linear plant and one tuning of UTC."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_lyapunov

from skydiver_utc.arrays import Array
from skydiver_utc.plants.linear import LinearModel
from skydiver_utc.theory.linear_plant import to_the_horizon
from skydiver_utc.theory.steady_gain import SteadyGain, gain, steady_gain

_MOST_TERMS = 1_000_000


class Riccati(NamedTuple):
    """Terms (n, n) of X - (F - G L)' X (F - G L) = cost + effort - additional, which must not be negative."""

    cost: Array
    effort: Array
    additional: Array

    @property
    def margin(self) -> float:
        """Smallest eigenvalue of cost + effort - additional."""
        return float(np.linalg.eigvalsh(self.cost + self.effort - self.additional)[0])


class Ball(NamedTuple):
    """Radii under z+ = Z z + d, |d| <= D: outside `radius` z'P z falls; `kept` is never left from within its level set
    p_max radius^2, `summed` never from rest.
    """

    radius: float
    kept: float
    summed: float


class Stability(NamedTuple):
    """Properties of the loop at its steady gain.

    Z (n+m, n+m), across (n+m, p) of `apart_from_rest`; eigenvalues (p,) of the distance from rest, the slowest
    first; slowest (n+m,), the real part of its eigenvector; decay per step, stable below 1; the Riccati terms for
    one step and for the horizon, at the steady covariance; the ball of a nonlinearity added to the state, None
    where the loop is not stable.
    """

    gain: SteadyGain
    Z: Array
    across: Array
    eigenvalues: NDArray[np.complex128]
    slowest: Array
    decay: float
    riccati_one_step: Riccati
    riccati: Riccati
    ball: Ball | None

    @property
    def stable(self) -> bool:
        """Whether the loop returns to rest."""
        return self.decay < 1.0


def analyse(plant: LinearModel, steps: int, Qu: Array, P_err: Array, nonlinearity: float) -> Stability:
    """`nonlinearity` is the largest |f| of x+ = A x + B u + f, which the controller's model does not have."""
    _, H = to_the_horizon(plant, steps)
    settled = steady_gain(H, P_err, Qu)
    Z = closed_loop_matrix(plant, settled.K, steps)
    across = apart_from_rest(plant, settled.K)
    distance = across.T @ Z @ across
    eigenvalues, vectors = np.linalg.eig(distance)
    order = np.argsort(-np.abs(eigenvalues))
    Pu = settled.covariance + Qu
    pushed = nonlinearity * float(np.linalg.norm(across[: len(plant.A)], 2))
    return Stability(
        gain=settled,
        Z=Z,
        across=across,
        eigenvalues=eigenvalues[order].astype(complex),
        slowest=across @ vectors[:, order[0]].real,
        decay=decay(distance),
        riccati_one_step=output_riccati(plant, Pu, P_err, 1),
        riccati=output_riccati(plant, Pu, P_err, steps),
        ball=ball(distance, pushed) if decay(distance) < 1.0 else None,
    )


def closed_loop_matrix(plant: LinearModel, K: Array, steps: int) -> Array:
    """Z (n+m, n+m) = [[A - B K F, B (I - K H)], [-K F, I - K H]], F and H of the horizon.

    For one step and C = I this is Z of arXiv 2504.08579, [[(I - B K) A, (I - B K) B], [-K A, I - K B]].
    """
    F, H = to_the_horizon(plant, steps)
    kept = np.eye(len(K)) - K @ H
    return np.block([[plant.A - plant.B @ K @ F, plant.B @ kept], [-K @ F, kept]])


def apart_from_rest(plant: LinearModel, K: Array) -> Array:
    """Orthonormal basis W (n+m, p) of what is across the states of rest of the loop.

    Any (x, u) with x = A x + B u and K C x = 0 stays where it is: Z has the eigenvalue 1 there, at least m - l
    times. The distance from rest is |W'z|, and it moves with W'Z W.
    """
    n, m = plant.B.shape
    conditions = np.block([[plant.A - np.eye(n), plant.B], [K @ plant.C, np.zeros((m, m))]])
    _, values, right = np.linalg.svd(conditions)
    return right[: int((values > 1e-10 * values[0]).sum())].T


def decay(matrix: Array) -> float:
    """Spectral radius: by how much what is slowest shrinks in a step."""
    return float(np.abs(np.linalg.eigvals(matrix)).max(initial=0.0))


def riccati_terms(F: Array, G: Array, X: Array, Pu: Array, L: Array) -> Riccati:
    """The terms for F (n, n), G (n, m), X (n, n), Pu (m, m) positive definite, and any gain L (m, n)."""
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


def ball(Z: Array, D: float) -> Ball:
    """The radii for a stable Z (p, p), after arXiv 2504.08579; raises `ValueError` where Z is not stable."""
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
