# SPDX-License-Identifier: Apache-2.0
"""Symmetric roots of covariances that may have lost their definiteness."""

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.jit import kernel

_SWEEPS = 30
# The square of what an entry may be beside the norm of its matrix.
_ROUNDING = 1e-34


@kernel
def symmetric_root(covariance: Array, floor: float, root: Array, vectors: Array) -> float:
    """Symmetric S (m, m) with S S = Pu, and by how much Pu had to be repaired for it.

    Pu is made symmetric and eigenvalues below `floor` are lifted to it, in `covariance` too. Returns the sum of what
    was added to the eigenvalues. These are found by cyclic Jacobi rotations, which make one entry (p, q) zero each.
    vectors (m + 1, m): scratch, for the eigenvectors and the eigenvalues
    """
    m, total = len(covariance), 0.0
    for i in range(m):
        for j in range(m):
            root[i, j] = 0.5 * (covariance[i, j] + covariance[j, i])
            vectors[i, j] = 1.0 if i == j else 0.0
            total += root[i, j] * root[i, j]
    for _ in range(_SWEEPS):
        for p in range(m):
            for q in range(p + 1, m):
                if root[p, q] * root[p, q] <= _ROUNDING * total:
                    continue
                theta = (root[q, q] - root[p, p]) / (2.0 * root[p, q])
                tangent = np.copysign(1.0, theta) / (abs(theta) + _hypotenuse(theta))
                cosine = 1.0 / _hypotenuse(tangent)
                sine = tangent * cosine
                for k in range(m):
                    a, b = root[k, p], root[k, q]
                    root[k, p], root[k, q] = cosine * a - sine * b, sine * a + cosine * b
                for k in range(m):
                    a, b = root[p, k], root[q, k]
                    root[p, k], root[q, k] = cosine * a - sine * b, sine * a + cosine * b
                    a, b = vectors[k, p], vectors[k, q]
                    vectors[k, p], vectors[k, q] = cosine * a - sine * b, sine * a + cosine * b
    lifted = 0.0
    values = vectors[m]
    for k in range(m):
        values[k] = max(root[k, k], floor)
        if not root[k, k] >= floor:  # NaN, too
            lifted += floor - root[k, k]
    for i in range(m):
        for j in range(m):
            entry, repaired = 0.0, 0.0
            for k in range(m):
                share = vectors[i, k] * vectors[j, k]
                entry += share * np.sqrt(values[k])
                repaired += share * values[k]
            root[i, j] = entry
            if lifted > 0.0:
                covariance[i, j] = repaired
    return lifted


@kernel
def _hypotenuse(leg: float) -> float:
    return np.sqrt(leg * leg + 1.0)
