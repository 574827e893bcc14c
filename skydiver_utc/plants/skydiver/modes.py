# SPDX-License-Identifier: Apache-2.0
"""Modes of a linearised fall, named after the states that take part in them most."""

from collections import Counter
from dataclasses import dataclass

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.plants.skydiver.linearise import STATES, tilt_axes
from skydiver_utc.plants.skydiver.steady import SteadyFall

_MOTIONS = ("roll", "pitch", "yaw", "fall rate", "glide", "slide")


@dataclass(frozen=True)
class Mode:
    """One mode: a real eigenvalue, or a pair of complex ones of which the upper is kept [1/s].

    shares: participation of each of the `STATES`, adding up to 1.
    """

    name: str
    eigenvalue: complex
    shares: dict[str, float]

    @property
    def stable(self) -> bool:
        """Whether the mode dies out."""
        return self.eigenvalue.real < 0.0

    @property
    def oscillates(self) -> bool:
        """Whether the eigenvalue is complex."""
        return self.eigenvalue.imag > 0.0

    @property
    def time_constant(self) -> float:
        """Time in which the mode changes by a factor e [s]; infinite where it does not."""
        return 1.0 / abs(self.eigenvalue.real) if self.eigenvalue.real else float("inf")

    @property
    def frequency(self) -> float:
        """Undamped natural frequency [Hz], 0 without oscillation."""
        return abs(self.eigenvalue) / (2.0 * np.pi) if self.oscillates else 0.0

    @property
    def damping_ratio(self) -> float:
        """Share of critical damping, negative where the oscillation grows; 1 without oscillation."""
        return -self.eigenvalue.real / abs(self.eigenvalue) if self.oscillates else 1.0


def modes(matrix: Array, fall: SteadyFall) -> list[Mode]:
    """Modes of a system matrix (8, 8) of `linearise`, fastest first.

    A state's participation is the product of its entries in the right and the left eigenvector: it has no unit, so
    no scale of the states sways the names.
    """
    eigenvalues, right = np.linalg.eig(matrix)
    participation = np.abs(right * np.linalg.inv(right).T)
    participation /= participation.sum(axis=0)
    found = [
        Mode(
            _name(complex(value), shares, fall),
            complex(value),
            dict(zip(STATES, map(float, shares), strict=True)),
        )
        for value, shares in zip(eigenvalues, participation.T, strict=True)
        if value.imag >= 0.0
    ]
    found.sort(key=lambda mode: -abs(mode.eigenvalue))
    return _numbered(found)


def _name(value: complex, shares: Array, fall: SteadyFall) -> str:
    """The motion with the largest share, and whether it dies out or grows."""
    side_tilt, pitch_tilt, roll, pitch, yaw, falling, gliding, sliding = shares
    side = tilt_axes(fall.up)[0]
    along = side[0] ** 2 / (side[0] ** 2 + side[2] ** 2)
    totals = (
        roll + along * side_tilt,
        pitch + pitch_tilt,
        yaw + (1.0 - along) * side_tilt,
        falling,
        gliding,
        sliding,
    )
    motion = _MOTIONS[int(np.argmax(totals))]
    if value.imag > 0.0:
        return f"{motion} oscillation"
    return f"{motion} subsidence" if value.real < 0.0 else f"{motion} divergence"


def _numbered(found: list[Mode]) -> list[Mode]:
    """Equal names made different by a number, the fastest first."""
    often, seen = Counter(mode.name for mode in found), Counter[str]()
    numbered = []
    for mode in found:
        seen[mode.name] += 1
        name = f"{mode.name} {seen[mode.name]}" if often[mode.name] > 1 else mode.name
        numbered.append(Mode(name, mode.eigenvalue, mode.shares))
    return numbered
