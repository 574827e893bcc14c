# SPDX-License-Identifier: Apache-2.0
"""The gain that UTC settles to on a linear plant: the fixed point of its covariance recursion (docs/theory.md).

    K = Pu H' (H Pu H' + P_err)^-1,    Pu+ = Pu - K H Pu + Qu

Only the part of Pu that the output sees has a fixed point; the gain settles all the same.
"""

from typing import NamedTuple

import numpy as np

from skydiver_utc.arrays import Array


class SteadyGain(NamedTuple):
    """Fixed point of the gain.

    K (m, l); covariance (m, m) of the controls as far as the output sees them, or they follow; growth (m, m) of
    Pu per step, zero where H has full column rank; memory (r,) the eigenvalues of I - K H below 1, ascending.
    From Pu = covariance + any multiple of growth the gain is steady from the first step.
    """

    K: Array
    covariance: Array
    growth: Array
    memory: Array


def gain(Pu: Array, H: Array, P_err: Array) -> Array:
    """K (m, l) for a covariance Pu (m, m), H (l, m), P_err (l, l)."""
    return np.asarray(np.linalg.solve(H @ Pu @ H.T + P_err, H @ Pu).T, dtype=float)


def steady_gain(H: Array, P_err: Array, Qu: Array) -> SteadyGain:
    """The fixed point in closed form; raises `ValueError` where Qu is not positive definite in what H sees.

    With M = V'H' P_err^-1 H V and T = M^1/2 V'Qu V M^1/2 it is P = M^-1/2 S M^-1/2, S = T/2 + (T^2/4 + T)^1/2, and
    I - K H has the eigenvalues 1 / (1 + s).
    """
    V = _row_space(H)
    noise = V.T @ Qu @ V
    root, inverse_root = _roots(V.T @ H.T @ np.linalg.solve(P_err, H @ V))
    values, vectors = np.linalg.eigh(root @ noise @ root)
    if values.size == 0 or values[0] <= 0.0:
        raise ValueError(
            "Qu is not positive definite in the controls that the output sees, so that Pu has no fixed point: give"
            " every control a variance in Qu"
        )
    s = values / 2 + np.sqrt(values**2 / 4 + values)
    # Unseen controls follow the seen ones as Qu relates them.
    follow = Qu @ V @ np.linalg.inv(noise)
    covariance = follow @ inverse_root @ (vectors * s) @ vectors.T @ inverse_root @ follow.T
    growth = Qu - follow @ noise @ follow.T
    return SteadyGain(gain(covariance, H, P_err), covariance, growth, np.sort(1.0 / (1.0 + s)))


def _row_space(H: Array) -> Array:
    """Orthonormal basis (m, r) of the rows of H."""
    _, values, right = np.linalg.svd(H, full_matrices=False)
    return right[values > 1e-12 * values[0]].T if values.size and values[0] > 0.0 else right[:0].T


def _roots(matrix: Array) -> tuple[Array, Array]:
    """Symmetric square root of a positive definite matrix, and its inverse."""
    values, vectors = np.linalg.eigh(matrix)
    return (vectors * np.sqrt(values)) @ vectors.T, (vectors / np.sqrt(values)) @ vectors.T
