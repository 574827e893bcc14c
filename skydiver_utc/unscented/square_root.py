"""Covariances kept as factors: Pu = S S' is never formed, so that it cannot lose its definiteness."""

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.jit import kernel

Array = NDArray[np.float64]

_SWEEPS = 30
# Share of a variance that a downdate leaves at the least: below it, 1 - p'p would be rounding.
_LEAST_LEFT = 1e-12


@kernel
def root_of_factor(
    factor: Array, floor: float, root: Array, values: Array, vectors: Array, rows: Array
) -> float:
    """Symmetric root (m, m) of Pu = S S' from any factor S (m, m), by one-sided Jacobi rotations.

    The rows of S are rotated until they are orthogonal: V' S has rows of length sigma, and the root is V sigma V'.
    sigma^2 below `floor` is lifted to it, in `factor` too, which then becomes the root; returns the sum of what was
    added to the eigenvalues of Pu. values (m,), vectors (m, m), rows (m, m) are scratch.
    """
    m = factor.shape[0]
    rows[:, :] = factor
    for i in range(m):
        for j in range(m):
            vectors[i, j] = 1.0 if i == j else 0.0
    for _ in range(_SWEEPS):
        rotated = False
        for p in range(m - 1):
            for q in range(p + 1, m):
                rotated = _make_orthogonal(rows, vectors, p, q) or rotated
        if not rotated:
            break
    lifted = 0.0
    for k in range(m):
        square = 0.0
        for j in range(m):
            square += rows[k, j] * rows[k, j]
        if square < floor:
            lifted += floor - square
        values[k] = np.sqrt(max(square, floor))
    for i in range(m):
        for j in range(m):
            entry = 0.0
            for k in range(m):
                entry += vectors[i, k] * vectors[j, k] * values[k]
            root[i, j] = entry
    if lifted > 0.0:
        factor[:, :] = root
    return lifted


@kernel
def _make_orthogonal(rows: Array, vectors: Array, p: int, q: int) -> bool:
    """Rotate the rows p and q against each other until their product is zero; False if it was."""
    a, b, c = 0.0, 0.0, 0.0
    for j in range(rows.shape[1]):
        a += rows[p, j] * rows[p, j]
        b += rows[q, j] * rows[q, j]
        c += rows[p, j] * rows[q, j]
    if abs(c) <= 1e-16 * np.sqrt(a * b):
        return False
    theta = (b - a) / (2.0 * c)
    tangent = 1.0 / (abs(theta) + np.sqrt(theta * theta + 1.0))
    if theta < 0.0:
        tangent = -tangent
    cosine = 1.0 / np.sqrt(tangent * tangent + 1.0)
    sine = tangent * cosine
    for j in range(rows.shape[1]):
        x, y = rows[p, j], rows[q, j]
        rows[p, j], rows[q, j] = cosine * x - sine * y, sine * x + cosine * y
        x, y = vectors[j, p], vectors[j, q]
        vectors[j, p], vectors[j, q] = cosine * x - sine * y, sine * x + cosine * y
    return True


@kernel
def lower_triangular(array: Array) -> None:
    """Make A (n, c), c >= n, the lower triangular L with L L' = A A', by Householder reflections of its rows."""
    rows, columns = array.shape
    for k in range(rows):
        square = 0.0
        for j in range(k, columns):
            square += array[k, j] * array[k, j]
        length = np.sqrt(square)
        if length == 0.0:
            continue
        # The sign that adds, so that nothing cancels; the diagonal is made positive afterwards.
        first = array[k, k] + (length if array[k, k] >= 0.0 else -length)
        half = 0.5 * (square - array[k, k] * array[k, k] + first * first)
        diagonal = array[k, k]
        for i in range(k + 1, rows):
            along = array[i, k] * first
            for j in range(k + 1, columns):
                along += array[i, j] * array[k, j]
            along /= half
            array[i, k] -= along * first
            for j in range(k + 1, columns):
                array[i, j] -= along * array[k, j]
            if diagonal >= 0.0:
                array[i, k] = -array[i, k]
        array[k, k] = length
        for j in range(k + 1, columns):
            array[k, j] = 0.0


@kernel
def take_away(factor: Array, size: int, outputs: int, vector: Array) -> float:
    """Rank-one downdate: L (size, size), lower triangular in the corner of `factor`, becomes that of L L' - z z'.

    z = `vector` (size,) is used up: with p = L^-1 z the result is L chol(I - p p'). Returns -1 where the first
    `outputs` rows would lose definiteness, and leaves L as it is. Where only the others would, as much is taken
    away as they can give; returns the trace of what they could not.
    """
    refused = 0.0
    of_outputs, of_others = 0.0, 0.0
    for i in range(size):
        total = vector[i]
        for k in range(i):
            total -= factor[i, k] * vector[k]
        if factor[i, i] > 0.0:
            vector[i] = total / factor[i, i]
        else:
            refused += total * total
            vector[i] = 0.0
        if i < outputs:
            of_outputs += vector[i] * vector[i]
        else:
            of_others += vector[i] * vector[i]
    if not of_outputs < 1.0:
        return -1.0
    if of_others > 0.0 and of_outputs + of_others > 1.0 - _LEAST_LEFT:
        given = max(1.0 - _LEAST_LEFT - of_outputs, 0.0) / of_others
        for i in range(outputs, size):
            along = 0.0
            for k in range(outputs, i + 1):
                along += factor[i, k] * vector[k]
            refused += along * along * (1.0 - given) / (1.0 - of_outputs)
        for i in range(outputs, size):
            vector[i] *= np.sqrt(given)
    left = 1.0
    for k in range(size):
        before = left
        left -= vector[k] * vector[k]
        for i in range(k, size):
            # Column k of L chol(I - p p'); the columns to its right are still those of L.
            right = 0.0
            for j in range(k + 1, i + 1):
                right += factor[i, j] * vector[j]
            factor[i, k] = (factor[i, k] * left - right * vector[k]) / np.sqrt(left * before)
    return refused
