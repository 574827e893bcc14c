"""A linear plant x+ = A x + B u + f, y = C x, as UTC sees it: from the state to the output at the horizon."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, expm

Array = NDArray[np.float64]

_DIVERGED = 1e60  # its fourth power, which the steady gain takes, is still a number


class LinearPlant(NamedTuple):
    """A (n, n), B (n, m), C (l, n) of one time step."""

    A: Array
    B: Array
    C: Array


def with_outputs_of_controls(plant: LinearPlant, drawn: Sequence[int]) -> LinearPlant:
    """The plant with these controls as further outputs, as those are that UTC draws to rest.

    Each is a further state, w+ = D u, so that F of the horizon has nothing of it and H has D. A (n+d, n+d),
    B (n+d, m), C (l+d, n+d) for d controls.
    """
    D = np.eye(plant.B.shape[1])[list(drawn)]
    A = block_diag(plant.A, np.zeros((len(D), len(D))))
    return LinearPlant(A, np.vstack([plant.B, D]), block_diag(plant.C, np.eye(len(D))))


def zero_order_hold(A: Array, B: Array, dt: float) -> tuple[Array, Array]:
    """A (n, n) and B (n, m) of one step of dt [s], the control held, from those of x' = A x + B u."""
    n, m = B.shape
    both = np.zeros((n + m, n + m))
    both[:n, :n], both[:n, n:] = A, B
    whole = expm(both * dt)
    return whole[:n, :n], whole[:n, n:]


def to_the_horizon(plant: LinearPlant, steps: int) -> tuple[Array, Array]:
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
