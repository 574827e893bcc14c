"""Small dense solves, written out so that kernels compile fast and do not allocate."""

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.jit import kernel

Array = NDArray[np.float64]


@kernel
def cholesky(matrix: Array) -> bool:
    """Replace the lower triangle of a symmetric matrix by its Cholesky factor; False if not positive definite."""
    for j in range(matrix.shape[0]):
        pivot = matrix[j, j]
        for k in range(j):
            pivot -= matrix[j, k] * matrix[j, k]
        if not (pivot > 0.0 and pivot < np.inf):
            return False
        matrix[j, j] = np.sqrt(pivot)
        for i in range(j + 1, matrix.shape[0]):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = total / matrix[j, j]
    return True


@kernel
def divide_by_upper(rows: Array, factor: Array) -> None:
    """Replace each row b (n, l) by b L^-T, where `factor` holds L in its lower triangle."""
    for row in range(rows.shape[0]):
        for i in range(rows.shape[1]):
            for k in range(i):
                rows[row, i] -= factor[i, k] * rows[row, k]
            rows[row, i] /= factor[i, i]


@kernel
def divide_by_lower(rows: Array, factor: Array) -> None:
    """Replace each row b (n, l) by b L^-1, where `factor` holds L in its lower triangle."""
    size = rows.shape[1]
    for row in range(rows.shape[0]):
        for i in range(size - 1, -1, -1):
            for k in range(i + 1, size):
                rows[row, i] -= factor[k, i] * rows[row, k]
            rows[row, i] /= factor[i, i]
