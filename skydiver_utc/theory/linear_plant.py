# SPDX-License-Identifier: Apache-2.0
"""A linear plant as UTC uses it: from the state and a held control to the output at the horizon."""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import block_diag

from skydiver_utc.arrays import Array
from skydiver_utc.plants.linear import LinearModel

_DIVERGED = 1e60  # its fourth power, which the steady gain takes, is still a number


def with_outputs_of_controls(plant: LinearModel, nominal: Sequence[int]) -> LinearModel:
    """The plant with these controls as further outputs, as UTC has them for a nominal control.

    Each is a further state, w+ = D u, so that F of the horizon has nothing of it and H has D. A (n+d, n+d),
    B (n+d, m), C (l+d, n+d) for d controls.
    """
    D = np.eye(plant.B.shape[1])[list(nominal)]
    A = block_diag(plant.A, np.zeros((len(D), len(D))))
    return LinearModel(A, np.vstack([plant.B, D]), block_diag(plant.C, np.eye(len(D))))


def to_the_horizon(plant: LinearModel, steps: int) -> tuple[Array, Array]:
    """F = C A^N (l, n) and H = C (A^(N-1) + .. + I) B (l, m): with u held, y is F x + H u after N steps.

    Raises `ValueError` where these pass 1e60.
    """
    free, forced = np.eye(len(plant.A)), np.zeros_like(plant.B)
    for k in range(steps):
        free, forced = plant.A @ free, plant.A @ forced + plant.B
        if not (np.abs(free).max() < _DIVERGED and np.abs(forced).max() < _DIVERGED):
            raise ValueError(
                f"without control the plant grows past {_DIVERGED:g} within {k + 1} of {steps} prediction steps:"
                " take fewer --steps"
            )
    return plant.C @ free, plant.C @ forced
