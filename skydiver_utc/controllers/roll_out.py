# SPDX-License-Identifier: Apache-2.0
"""The roll-out that every predicting controller uses: many points, each driving the model to the horizon.

A point is what stands for a control over the horizon: with no dynamics it is the control itself, held; with
dynamics it is whatever these make a control of, step by step: a control whose own law goes on inside the horizon,
or a sequence in blocks. The functions are machine code called by address (`skydiver_utc.jit.call`), or, where the
user's model is plain Python, Python functions called by the same text interpreted.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numba.core.errors import NumbaError
from numpy.typing import NDArray

from skydiver_utc.jit import address, call, interpreted, is_jitted, program
from skydiver_utc.plants.protocol import LEFT_ITS_DOMAIN, MISTAKES, Model, one_line

Array = NDArray[np.float64]
Steps = NDArray[np.int64]


class Dynamics(NamedTuple):
    """How a point becomes a control: a program, or None for a held control, and its numbers.

    function(point (p,), before (m,), state (n,), y (L,), y_before (L,), preview (N+1, l), j, numbers, out (m,)) writes
    the control wanted on step j; before is the control on the step before, y the model's outputs now and y_before one
    step ago, at the start the same as now. Without `sees_outputs` y and y_before are not computed.
    """

    function: Any
    numbers: Array
    sees_outputs: bool


@program
def roll_out(
    step: Any,
    outputs_of: Any,
    parameters: Any,
    dynamics: Any,
    numbers: Array,
    kind: int,
    steps: Steps,
    selected: Steps,
    begin: Steps,
    limits: Array,
    state: Array,
    applied: Array,
    points: Array,
    preview: Array,
    named: int,
    outputs: Array,
    first: Array,
) -> None:
    """Drive the model with points (S, p) from state (n,) and the control now applied (m,).

    kind: 0 for held points, 1 for dynamics, 2 for dynamics that see the `named` outputs
    steps (T,) rising: after which steps the selected outputs (l,) are written, to outputs (S, T l); NaN from where a
        point diverges
    begin (S,): the steps that a point has in common with the first point, which are not computed again
    limits (3, m): minimum, maximum and largest change per step of the control
    first (S, m): the control on the first step
    """
    x, control, wanted = np.empty(state.shape[0]), np.empty(applied.shape[0]), np.empty(applied.shape[0])
    y, y_before = np.empty(named), np.empty(named)
    n, m, chosen = x.shape[0], control.shape[0], selected.shape[0]
    last = steps[steps.shape[0] - 1]
    states, controls = np.empty((last + 1, n)), np.empty((last + 1, m))
    for a in range(n):
        states[0, a] = state[a]
    for c in range(m):
        controls[0, c] = applied[c]
    for i in range(points.shape[0]):
        start = begin[i]
        for a in range(n):
            x[a] = states[start, a]
        for c in range(m):
            control[c] = controls[start, c]
        taken = 0
        while steps[taken] <= start:
            for k in range(chosen):
                outputs[i, taken * chosen + k] = outputs[0, taken * chosen + k]
            taken += 1
        for k in range(taken * chosen, outputs.shape[1]):
            outputs[i, k] = np.nan
        if kind == 2:
            call(outputs_of, (x, parameters, y))
            for k in range(named):
                y_before[k] = y[k]
        for j in range(start, last):
            if kind == 0:
                for c in range(m):
                    wanted[c] = points[i, c]
            else:
                call(dynamics, (points[i], control, x, y, y_before, preview, j, numbers, wanted))
            diverged = False
            for c in range(m):
                diverged = diverged or not abs(wanted[c]) < np.inf
                value, before = min(max(wanted[c], limits[0, c]), limits[1, c]), control[c]
                control[c] = min(max(value, before - limits[2, c]), before + limits[2, c])
                if j == 0:
                    first[i, c] = control[c]
            if not diverged:
                call(step, (x, control, parameters, x))
            for a in range(n):
                # A comparison, because the compiler may fold np.isfinite (x - x == 0) of a sum.
                diverged = diverged or not abs(x[a]) < np.inf
            if diverged:
                break
            if i == 0:
                for a in range(n):
                    states[j + 1, a] = x[a]
                for c in range(m):
                    controls[j + 1, c] = control[c]
            if kind == 2:
                for k in range(named):
                    y_before[k] = y[k]
            if kind == 2 or j + 1 == steps[taken]:
                call(outputs_of, (x, parameters, y))
            if j + 1 == steps[taken]:
                for k in range(chosen):
                    outputs[i, taken * chosen + k] = y[selected[k]]
                taken += 1


class RollOut:
    """The roll-out bound to a model: compiled if the model is, else the same text interpreted.

    A function of the user's that raises an ArithmeticError, ValueError (LinAlgError is one) or IndexError has left
    where it is defined: that point diverges there, and `cause` holds the first such error. Every other error of
    Python's own becomes a ValueError that names the function.
    """

    def __init__(
        self,
        model: Model,
        named: int,
        steps: Sequence[int],
        selected: Sequence[int],
        limits: Array,
        points: tuple[int, int],
        dynamics: Dynamics | None = None,
    ) -> None:
        """named: how many outputs the model has; points: shape (S, p) of the points."""
        m, of_plant = limits.shape[1], len(steps) * len(selected)
        self.points, self.outputs = np.empty(points), np.empty((points[0], of_plant))
        self.first = np.empty((points[0], m))
        self.begin = np.zeros(points[0], dtype=np.int64)
        self.cause = ""
        numbers = np.zeros(1) if dynamics is None else dynamics.numbers
        kind = 0 if dynamics is None else 1 + dynamics.sees_outputs
        self._constant = (
            numbers, kind, np.array(steps, dtype=np.int64), np.array(selected, dtype=np.int64), self.begin, limits,
        )  # fmt: skip
        self._named = named
        parameters, state, control, y = (
            model.parameters,
            np.empty(model.state_size),
            np.empty(m),
            np.empty(named),
        )
        wanted = None if dynamics is None else dynamics.function
        functions = [model.step, model.outputs] + ([] if wanted is None else [wanted])
        self._python = (model.step, model.outputs, parameters, wanted)
        self._compiled: tuple[Any, ...] | None = None
        if all(map(is_jitted, functions)):
            where = 0
            if wanted is not None:
                example = (self.points[0], control, state, y, y, np.empty((1, 1)), 0, numbers, control)
                where = _compiled(wanted, *example)
            self._compiled = (
                _compiled(model.step, state, control, parameters, state),
                _compiled(model.outputs, state, parameters, y),
                tuple(parameters),
                where,
            )
        self._interpreted = interpreted(roll_out, call=self._guarded)

    def __call__(self, state: Array, applied: Array, preview: Array) -> None:
        """Write `outputs` (S, T l) and `first` (S, m) of `points` (S, p) from a state and the control now applied."""
        given = (*self._constant, state, applied, self.points, preview, self._named, self.outputs, self.first)
        if self._compiled is not None:
            try:
                roll_out(*(self._compiled + given))
            except (*LEFT_ITS_DOMAIN, *MISTAKES):
                pass  # Compiled code cannot go on with the other points: the same again from Python.
            else:
                return
        self.cause = ""
        with np.errstate(all="ignore"):
            self._interpreted(*self._python, *given)

    def _guarded(self, function: Any, arguments: tuple[Any, ...]) -> None:
        try:
            function(*arguments)
        except LEFT_ITS_DOMAIN as error:
            arguments[-1][:] = np.nan
            self.cause = self.cause or f"{function.__name__} raises {type(error).__name__}: {one_line(error)}"
        except MISTAKES as error:
            raise ValueError(
                f"{function.__name__} fails inside the horizon ({type(error).__name__}: {one_line(error)})."
            ) from error


def _compiled(function: Any, *example: Any) -> int:
    """The address of a function; a ValueError names one that does not compile."""
    try:
        return address(function, *example)
    except NumbaError as error:
        raise ValueError(f"{function.__name__} does not compile: {one_line(error)}.") from error
