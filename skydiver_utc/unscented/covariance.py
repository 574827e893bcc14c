"""Symmetric roots of covariances that may have lost their definiteness."""

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.jit import kernel

Array = NDArray[np.float64]

_SWEEPS = 30


@kernel
def eigen_symmetric(matrix: Array, values: Array, vectors: Array) -> None:
    """Eigenvalues (m,) and eigenvectors, as columns (m, m), of a symmetric matrix by cyclic Jacobi rotations.

    `matrix` is used up.
    """
    m = matrix.shape[0]
    for i in range(m):
        for j in range(m):
            vectors[i, j] = 1.0 if i == j else 0.0
    for _ in range(_SWEEPS):
        off, total = 0.0, 0.0
        for i in range(m):
            for j in range(m):
                total += matrix[i, j] * matrix[i, j]
                if i != j:
                    off += matrix[i, j] * matrix[i, j]
        if off <= 1e-32 * total:
            break
        for p in range(m - 1):
            for q in range(p + 1, m):
                if matrix[p, q] != 0.0:
                    _rotate(matrix, vectors, p, q)
    for i in range(m):
        values[i] = matrix[i, i]


@kernel
def _rotate(matrix: Array, vectors: Array, p: int, q: int) -> None:
    """One Jacobi rotation that makes the entry (p, q) zero."""
    theta = (matrix[q, q] - matrix[p, p]) / (2.0 * matrix[p, q])
    tangent = 1.0 / (abs(theta) + np.sqrt(theta * theta + 1.0))
    if theta < 0.0:
        tangent = -tangent
    cosine = 1.0 / np.sqrt(tangent * tangent + 1.0)
    sine = tangent * cosine
    for k in range(matrix.shape[0]):
        a, b = matrix[k, p], matrix[k, q]
        matrix[k, p], matrix[k, q] = cosine * a - sine * b, sine * a + cosine * b
    for k in range(matrix.shape[0]):
        a, b = matrix[p, k], matrix[q, k]
        matrix[p, k], matrix[q, k] = cosine * a - sine * b, sine * a + cosine * b
        a, b = vectors[k, p], vectors[k, q]
        vectors[k, p], vectors[k, q] = cosine * a - sine * b, sine * a + cosine * b


@kernel
def symmetric_root(
    covariance: Array, floor: float, keep: bool, root: Array, values: Array, vectors: Array
) -> float:
    """Symmetric S (m, m) with S S = Pu, and by how much Pu had to be repaired for it.

    Pu is made symmetric and eigenvalues below `floor` are lifted to it, in `covariance` too unless `keep` is
    set: then only the root leaves the negative eigenvalues out (the real part of the complex root).
    Returns the sum of what was added to the eigenvalues. values (m,), vectors (m, m) are scratch.
    """
    m = covariance.shape[0]
    for i in range(m):
        for j in range(m):
            root[i, j] = 0.5 * (covariance[i, j] + covariance[j, i])
    eigen_symmetric(root, values, vectors)
    lifted = 0.0
    for k in range(m):
        if values[k] < floor:
            lifted += floor - values[k]
    for i in range(m):
        for j in range(m):
            entry, repaired = 0.0, 0.0
            for k in range(m):
                eigenvalue = max(values[k], floor)
                if keep:
                    eigenvalue = max(values[k], 0.0)
                share = vectors[i, k] * vectors[j, k]
                entry += share * np.sqrt(eigenvalue)
                repaired += share * eigenvalue
            root[i, j] = entry
            if lifted > 0.0 and not keep:
                covariance[i, j] = repaired
    return lifted
