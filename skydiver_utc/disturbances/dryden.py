# SPDX-License-Identifier: Apache-2.0
"""Dryden turbulence, as in MIL-F-8785C (1980), 3.7.1, and MIL-HDBK-1797 (1997)."""

import math
from collections.abc import Iterator
from typing import Annotated, Literal

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.disturbances.protocol import Disturbance
from skydiver_utc.disturbances.rows import BLOCK, Rows
from skydiver_utc.parameters.fields import SlotSettings, quantity
from skydiver_utc.plants.protocol import Plant
from skydiver_utc.rotations import turn_into_world

_LEAST_SPEED_M_S = 1.0


class DrydenTurbulence(Disturbance):
    """Turbulent air, frozen, through which a body moves with the speed V at which the plant starts.

    The longitudinal axis is that of the initial velocity relative to the air: of a body that falls the vertical. With
    t = L / V, each one-sided over the circular frequency w and with the variance s2 = sigma^2:

        along   2 s2 t / pi / (1 + (t w)^2)
        across  s2 t / pi (1 + 3 (t w)^2) / (1 + (t w)^2)^2, on both axes

    which are 1/(1 + t s) and (1 + sqrt(3) t s)/(1 + t s)^2 behind white noise, here solved exactly from step to step
    and stationary from step 0 on. MIL-HDBK-1797 writes 2 L for L across, with half the length.
    """

    class Settings(SlotSettings):
        """Intensity and scale length."""

        kind: Literal["dryden"] = "dryden"
        sigma_m_s: Annotated[
            float, quantity("m/s", "standard deviation of each component of the wind", ge=0, le=20)
        ]
        # 1750 ft, both standards above 2000 ft.
        scale_m: Annotated[float, quantity("m", "scale length L", ge=10, le=5000)] = 533.4

    def __init__(self, settings: Settings, plant: Plant, dt_s: float, seed: tuple[int, int]) -> None:
        state = np.asarray(plant.initial_state())
        velocity = np.zeros(3)
        if plant.state_message == "odometry":
            turn_into_world(state[3:7], state[7:10], velocity)
        speed = float(np.linalg.norm(velocity))
        if speed < _LEAST_SPEED_M_S:
            raise ValueError(
                f"the plant starts with {speed:g} m/s in the air: turbulence needs one that moves through it"
            )
        self._sigma, self._seed = settings.sigma_m_s, seed
        self.acts = self._sigma > 0.0
        self._axes = _axes(velocity / speed)
        self._transition, self._covariance = filters(dt_s * speed / settings.scale_m)
        self._rows = Rows(self._blocks)

    def wind(self, k: int) -> Array:
        return self._rows[max(k, 0)]

    def _blocks(self) -> Iterator[Array]:
        """The filters' outputs in the world, from states (5,) that are stationary."""
        random = np.random.default_rng(self._seed)
        A, P = self._transition, self._covariance
        root = _root(P - A @ P @ A.T)
        decay, fed = float(A[0, 0]), float(A[2, 1])
        p, p1, q1, p2, q2 = (_root(P) @ random.standard_normal(5)).tolist()
        while True:
            states = []
            # A x + noise, in Python's own numbers: faster than five-by-five products.
            for n, n1, m1, n2, m2 in (random.standard_normal((BLOCK, 5)) @ root.T).tolist():
                states.append((p, p1, q1, p2, q2))
                q1, q2 = decay * q1 + fed * p1 + m1, decay * q2 + fed * p2 + m2
                p, p1, p2 = decay * p + n, decay * p1 + n1, decay * p2 + n2
            yield self._sigma * (np.array(states) @ OUTPUT.T) @ self._axes.T


# Along, and on both axes across, from the filters' states (5,), for a sigma of 1.
_ACROSS = np.array([math.sqrt(3.0), 1.0 - math.sqrt(3.0)]) / math.sqrt(2.0)
OUTPUT = np.array([[1.0, 0, 0, 0, 0], [0, *_ACROSS, 0, 0], [0, 0, 0, *_ACROSS]])


def filters(share: float) -> tuple[Array, Array]:
    """Transition (5, 5) over a step of `share` t, and the stationary covariance, of the states of the filters.

    p along; p and q across with t p' = -p + n, t q' = -q + p and white noise n that gives p the variance 1.
    """
    decay = math.exp(-share)
    A, P = np.zeros((5, 5)), np.zeros((5, 5))
    A[0, 0], P[0, 0] = decay, 1.0
    for i in (1, 3):
        A[i : i + 2, i : i + 2] = [[decay, 0.0], [share * decay, decay]]
        P[i : i + 2, i : i + 2] = [[1.0, 0.5], [0.5, 0.5]]
    return A, P


def _root(covariance: Array) -> Array:
    """A matrix whose product with its transpose is the covariance, which may be singular."""
    values, vectors = np.linalg.eigh(covariance)
    root: Array = vectors * np.sqrt(np.maximum(values, 0.0))
    return root


def _axes(along: Array) -> Array:
    """Unit vectors as columns (3, 3): the first along, the others across."""
    across = np.cross(along, np.eye(3)[int(np.argmin(np.abs(along)))])
    across /= np.linalg.norm(across)
    return np.column_stack([along, across, np.cross(along, across)])
