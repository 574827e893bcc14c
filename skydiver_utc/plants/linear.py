# SPDX-License-Identifier: Apache-2.0
"""Linear plants, given by their matrices."""

from typing import Annotated, Literal, NamedTuple

import numpy as np
from pydantic import model_validator
from typing_extensions import Self

from skydiver_utc.arrays import Array
from skydiver_utc.jit import allocating, inlined
from skydiver_utc.parameters.fields import SlotSettings, text
from skydiver_utc.parameters.linear_plant import LinearSettings
from skydiver_utc.plants.protocol import Model, Plant


class LinearModel(NamedTuple):
    """A (n, n), B (n, m), C (l, n) of one step: x+ = A x + B u, y = C x."""

    A: Array
    B: Array
    C: Array


@allocating
def linear_step(state: Array, control: Array, parameters: LinearModel, out: Array) -> None:
    """x+ = A x + B u (n,)."""
    A, B = parameters.A, parameters.B
    following = np.zeros(A.shape[0])
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            following[i] += A[i, j] * state[j]
        for j in range(B.shape[1]):
            following[i] += B[i, j] * control[j]
    for i in range(A.shape[0]):
        out[i] = following[i]


@inlined
def linear_outputs(state: Array, parameters: LinearModel, out: Array) -> None:
    """y = C x (l,)."""
    C = parameters.C
    for i in range(C.shape[0]):
        out[i] = 0.0
        for j in range(C.shape[1]):
            out[i] += C[i, j] * state[j]


def zero_order_hold(A: Array, B: Array, dt_s: float) -> tuple[Array, Array]:
    """A (n, n) and B (n, m) of one step of dt, the control held, from those of x' = A x + B u."""
    from scipy.linalg import expm

    n, m = B.shape
    both = np.zeros((n + m, n + m))
    both[:n, :n], both[:n, n:] = A, B
    held = expm(both * dt_s)
    return np.ascontiguousarray(held[:n, :n]), np.ascontiguousarray(held[:n, n:])


def linear_model(settings: LinearSettings, dt_s: float) -> LinearModel:
    """The matrices of one step of dt."""
    A, B = np.array(settings.A, dtype=float), np.array(settings.B, dtype=float)
    if settings.time == "continuous":
        A, B = zero_order_hold(A, B, dt_s)
    return LinearModel(A, B, np.eye(len(A)) if settings.C is None else np.array(settings.C, dtype=float))


class LinearPlant(Plant):
    """A linear plant; its state starts at `initial` and its controls have bounds but no rates."""

    class Settings(SlotSettings, LinearSettings):
        """Matrices, names and limits."""

        kind: Literal["linear"] = "linear"
        states: Annotated[tuple[str, ...], text("names of the states")]
        controls: Annotated[tuple[str, ...], text("names of the controls")]
        outputs: Annotated[
            tuple[str, ...] | None, text("names of the outputs; those of the states without")
        ] = None
        initial: Annotated[tuple[float, ...], text("state at step 0")]
        minimum: Annotated[tuple[float, ...], text("smallest value of each control")]
        maximum: Annotated[tuple[float, ...], text("largest value of each control")]

        @model_validator(mode="after")
        def _check_sizes(self) -> Self:
            n, m, count = self.sizes
            outputs = self.states if self.outputs is None else self.outputs
            sizes = {"states": n, "initial": n, "controls": m, "minimum": m, "maximum": m}
            rows = {name: getattr(self, name) for name in sizes} | {"outputs": outputs}
            for name, size in (sizes | {"outputs": count}).items():
                if len(rows[name]) != size:
                    raise ValueError(f"{name} must have {size} entries, as the matrices have it")
            return self

    def __init__(self, settings: Settings, dt_s: float) -> None:
        self.dt_s = dt_s
        self.state_names, self.control_names = settings.states, settings.controls
        self.output_names = settings.states if settings.outputs is None else settings.outputs
        self.minimum, self.maximum = np.array(settings.minimum), np.array(settings.maximum)
        self.rate = np.full(len(self.control_names), np.inf)
        self._initial = np.array(settings.initial, dtype=float)
        self.model = Model(linear_step, linear_outputs, linear_model(settings, dt_s), len(self._initial))

    def initial_state(self) -> Array:
        return self._initial.copy()
