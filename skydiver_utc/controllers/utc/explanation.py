# SPDX-License-Identifier: Apache-2.0
"""Which control moves which output: a table for whoever tunes a controller."""

from dataclasses import dataclass

import numpy as np

from skydiver_utc.arrays import Array, Integers


@dataclass(frozen=True, eq=False)
class Explanation:
    """The effect of the controls over the horizon, from one state. Printed, it is a small table.

    controls (m,), outputs (l,): names; horizon: steps to where the outputs are predicted, the last one of several
    control, minimum, maximum, deviation (m,): of the controls; deviation is sqrt(Pu)
    moves (m, l): by how much a change of one deviation moves an output at the horizon
    unit (l,): sqrt(P_err); distance (l,): the reference less the predicted output
    clipped (m,): of the 2m+1 sigma points, how many stand on a bound of the control
    diverged: how many do not reach the horizon; cause: by which error the first
    hints: what to change, in words
    """

    controls: tuple[str, ...]
    outputs: tuple[str, ...]
    horizon: int
    control: Array
    minimum: Array
    maximum: Array
    deviation: Array
    moves: Array
    unit: Array
    distance: Array
    clipped: Integers
    diverged: int
    cause: str

    @property
    def hints(self) -> tuple[str, ...]:
        """Advice on the settings, in words."""
        found = []
        if self.diverged:
            cause = f" ({self.cause})" if self.cause else ""
            found.append(
                f"{self.diverged} sigma points diverge{cause}: give a smaller Pu, or a shorter horizon"
            )
        if self.diverged > 2 * len(self.controls):
            return tuple(found)
        for name, unit, moved in zip(self.outputs, self.unit, np.abs(self.moves).max(axis=0), strict=True):
            if not moved > 0.0:
                found.append(f"no control moves {name}: take a longer horizon, or another output")
            elif unit > moved:
                found.append(
                    f"sqrt(P_err) of {name} is {unit / moved:.3g} times what the controls move it: a step takes up a"
                    " small share of the distance; give a smaller P_err, or a larger Pu or Qu"
                )
        frozen = self.minimum == self.maximum
        for name, moved, held in zip(self.controls, np.abs(self.moves), frozen, strict=True):
            if held:
                found.append(f"{name} is frozen: its bounds are equal")
            elif not (moved > 1e-3 * self.unit).any():
                found.append(f"{name} moves no output: give it a nominal value, or a forgetting_factor")
        return tuple(found)

    def __str__(self) -> str:
        head = ["control", "now", "minimum", "maximum", "deviation", "clipped"]
        rows = [[*head, *(f"-> {name}" for name in self.outputs)]]
        for c, name in enumerate(self.controls):
            values = (self.control[c], self.minimum[c], self.maximum[c], self.deviation[c])
            rows.append(
                [name, *(f"{v:.3g}" for v in values), str(self.clipped[c]), *(f"{v:.3g}" for v in self.moves[c])]
            )  # fmt: skip
        rows.append(["sqrt(P_err)", *[""] * 5, *(f"{v:.3g}" for v in self.unit)])
        rows.append(["reference - predicted", *[""] * 5, *(f"{v:.3g}" for v in self.distance)])
        width = [max(map(len, cells)) for cells in zip(*rows, strict=True)]
        lines = [
            "  ".join(cell.rjust(w) for cell, w in zip(row, width, strict=True)).rstrip() for row in rows
        ]
        return "\n".join([f"one deviation of each control, over {self.horizon} steps", *lines, *self.hints])
