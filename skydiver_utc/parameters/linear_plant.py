# SPDX-License-Identifier: Apache-2.0
"""Linear plants by their matrices; and such a plant with a tuning of UTC, for ``skydiver-utc stability``."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator
from typing_extensions import Self

from skydiver_utc.arrays import Array
from skydiver_utc.parameters.fields import Parameters, quantity, text
from skydiver_utc.parameters.loading import load_named

Matrix = tuple[tuple[float, ...], ...]
Variance = Annotated[float, quantity("1", "a variance", gt=0)]


class LinearSettings(Parameters):
    """x' = A x + B u in continuous time, or x+ = A x + B u of one step; y = C x, the whole state without C."""

    time: Annotated[Literal["continuous", "discrete"], text("whether A and B give x', or x+ of one step")]
    A: Annotated[Matrix, text("state matrix (n, n)")]
    B: Annotated[Matrix, text("control matrix (n, m)")]
    C: Annotated[Matrix | None, text("output matrix (l, n); the whole state without it")] = None

    @property
    def sizes(self) -> tuple[int, int, int]:
        """n, m and l."""
        n = len(self.A)
        return n, len(next(iter(self.B), ())), n if self.C is None else len(self.C)

    @model_validator(mode="after")
    def _check_shapes(self) -> Self:
        n, m, outputs = self.sizes
        for name, rows, shape in (("A", self.A, (n, n)), ("B", self.B, (n, m)), ("C", self.C, (outputs, n))):
            if rows is not None and (
                len(rows) != shape[0] or not shape[1] or {len(r) for r in rows} != {shape[1]}
            ):
                raise ValueError(
                    f"{name} must have {shape[0]} rows of {shape[1]} numbers, as A and B have it"
                )
        return self


class TunedLinearSettings(LinearSettings):
    """A linear plant with a tuning of UTC."""

    name: str
    description: str
    source: Annotated[str, text("where the numbers come from")] = ""
    dt_s: Annotated[float, quantity("s", "time step; the control is held over it", gt=0, le=100)]
    Qu: Annotated[
        tuple[float, ...] | Matrix,
        text(
            "what the controls' covariance gains per step: a variance for each control, or the whole matrix"
        ),
    ]
    P_err: Annotated[tuple[Variance, ...], Field(description="variance of each output's tracking error")]
    horizon_steps: Annotated[int, quantity("steps", "prediction horizon N", ge=1, le=500)] = 1
    nonlinearity: Annotated[
        float, quantity("state", "largest size of what is added to the state each step", ge=0)
    ] = 0.0

    @property
    def process_noise(self) -> Array:
        """Qu as a matrix (m, m)."""
        given = np.array(self.Qu, dtype=float)
        return np.diag(given) if given.ndim == 1 else given

    @model_validator(mode="after")
    def _check_tuning(self) -> Self:
        _, m, outputs = self.sizes
        if len(self.Qu) != m or any(isinstance(row, tuple) and len(row) != m for row in self.Qu):
            raise ValueError(
                f"Qu must have one variance for each of the {m} controls, or {m} rows of {m} numbers"
            )
        Qu = self.process_noise
        if not (np.array_equal(Qu, Qu.T) and np.linalg.eigvalsh(Qu)[0] > 0.0):
            raise ValueError("Qu is no covariance: make it symmetric with positive eigenvalues")
        if len(self.P_err) != outputs:
            raise ValueError(f"P_err must have {outputs} numbers, one for each output")
        if not np.any(self.B):
            raise ValueError("B is zero: give the controls an effect")
        return self


def load_linear_plant(name_or_path: str) -> TunedLinearSettings:
    """A name below config/linear_plants or the path of a YAML file. Raises `ParameterError`."""
    return load_named(TunedLinearSettings, "linear_plant", name_or_path)
