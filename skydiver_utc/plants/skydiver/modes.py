# SPDX-License-Identifier: Apache-2.0
"""Modes of a linearised fall, named after the states that take part in them most."""

from typing import Any, NamedTuple

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.plants.skydiver.linearise import STATES, tilt_axes
from skydiver_utc.plants.skydiver.steady import SteadyFall

_MOTIONS = ("roll", "pitch", "yaw", "fall rate", "glide", "slide")


class Mode(NamedTuple):
    """One mode: a real eigenvalue, or a pair of complex ones of which the upper is kept [1/s].

    shares: participation of each of the `STATES`, adding up to 1.
    """

    name: str
    eigenvalue: complex
    shares: dict[str, float]

    def as_dict(self) -> dict[str, Any]:
        """Plain data; time constant that of a change by a factor e, None where there is none; undamped frequency.

        The damping ratio is the share of critical damping, negative where the oscillation grows.
        """
        rate, size, oscillates = self.eigenvalue.real, abs(self.eigenvalue), self.eigenvalue.imag > 0.0
        return {
            "name": self.name,
            "stable": rate < 0.0,
            "eigenvalue_1_s": [rate, self.eigenvalue.imag],
            "time_constant_s": 1.0 / abs(rate) if rate else None,
            "frequency_hz": size / (2.0 * np.pi) if oscillates else None,
            "damping_ratio": -rate / size if oscillates else None,
            "shares": self.shares,
        }


def modes(matrix: Array, fall: SteadyFall) -> list[Mode]:
    """Modes of a system matrix (8, 8) of `linearise`, fastest first.

    A state's participation is the product of its entries in the right and the left eigenvector: it has no unit, so
    no scale of the states sways the names. Of equal names the fastest has the number 1.
    """
    eigenvalues, right = np.linalg.eig(matrix)
    participation = np.abs(right * np.linalg.inv(right).T)
    participation /= participation.sum(axis=0)
    upper = [i for i, value in enumerate(eigenvalues) if value.imag >= 0.0]
    upper.sort(key=lambda i: -abs(complex(eigenvalues[i])))
    names = [_name(complex(eigenvalues[i]), participation[:, i], fall) for i in upper]
    found = []
    for k, (i, name) in enumerate(zip(upper, names, strict=True)):
        numbered = f"{name} {names[: k + 1].count(name)}" if names.count(name) > 1 else name
        shares = dict(zip(STATES, map(float, participation[:, i]), strict=True))
        found.append(Mode(numbered, complex(eigenvalues[i]), shares))
    return found


def _name(value: complex, shares: Array, fall: SteadyFall) -> str:
    """The motion with the largest share, and whether it dies out or grows."""
    side, totals = tilt_axes(fall.up)[0], shares[2:].copy()
    along = side[0] ** 2 / (side[0] ** 2 + side[2] ** 2)
    # Tilts belong to the body axes about which they turn.
    totals[:3] += along * shares[0], shares[1], (1.0 - along) * shares[0]
    motion = _MOTIONS[int(np.argmax(totals))]
    if value.imag > 0.0:
        return f"{motion} oscillation"
    return f"{motion} subsidence" if value.real < 0.0 else f"{motion} divergence"
