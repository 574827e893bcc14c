# SPDX-License-Identifier: Apache-2.0
"""Linear algebra of covariances, written out so that it compiles fast."""

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.jit import kernel


@kernel
def gain(C_y: Array, C_uy: Array, P: Array) -> bool:
    """Make C_uy (m, l) the gain K = C_uy C_y^-1, and take K C_y K' from P (m, m); False if C_y is not definite.

    The lower triangle of C_y (l, l) becomes its Cholesky factor L. C_uy and P are changed only if the answer is True.
    """
    m, l = C_uy.shape
    for j in range(l):
        pivot = C_y[j, j]
        for k in range(j):
            pivot -= C_y[j, k] * C_y[j, k]
        if not (pivot > 0.0 and pivot < np.inf):
            return False
        C_y[j, j] = np.sqrt(pivot)
        for i in range(j + 1, l):
            total = C_y[i, j]
            for k in range(j):
                total -= C_y[i, k] * C_y[j, k]
            C_y[i, j] = total / C_y[j, j]
    # With G = C_uy L^-T: K C_y K' = G G' and K = G L^-1.
    for a in range(m):
        for i in range(l):
            for k in range(i):
                C_uy[a, i] -= C_y[i, k] * C_uy[a, k]
            C_uy[a, i] /= C_y[i, i]
    for a in range(m):
        for b in range(m):
            for k in range(l):
                P[a, b] -= C_uy[a, k] * C_uy[b, k]
    for a in range(m):
        for i in range(l - 1, -1, -1):
            for k in range(i + 1, l):
                C_uy[a, i] -= C_y[k, i] * C_uy[a, k]
            C_uy[a, i] /= C_y[i, i]
    return True


@kernel
def trace(matrix: Array) -> float:
    """Sum of the diagonal."""
    total = 0.0
    for k in range(len(matrix)):
        total += matrix[k, k]
    return total


@kernel
def raise_diagonal(matrix: Array, share: float) -> None:
    """Add this share of its trace to each entry of the diagonal."""
    added = share * trace(matrix)
    for k in range(len(matrix)):
        matrix[k, k] += added
