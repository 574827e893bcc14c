# SPDX-License-Identifier: Apache-2.0
"""The roll-out that every predicting controller uses: many points, each driving the model to the horizon.

A point is what stands for a control over the horizon: with no dynamics it is the control itself, held; with
dynamics it is whatever these make a control of, step by step: a control whose own law goes on inside the horizon,
or a sequence in blocks. The functions are machine code called by address (`skydiver_utc.jit.call`), or, where the
user's model is plain Python, Python functions called by the same text interpreted.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numba.core.errors import NumbaError

from skydiver_utc.arrays import Array, Integers
from skydiver_utc.controllers.limits import limit
from skydiver_utc.jit import (
    InMemory,
    address,
    by_address,
    call,
    in_memory,
    interpreted,
    is_jitted,
    program,
)
from skydiver_utc.plants.protocol import LEFT_ITS_DOMAIN, MISTAKES, Model, one_line


class Dynamics(NamedTuple):
    """The control of a point over the horizon: a program, or None for a held control, and its numbers.

    function(point (p,), before (m,), state (n,), y (L,), y_before (L,), preview (N+1, l), j, numbers, out (m,)) writes
    the control wanted on step j; before is the control on the step before, y the model's outputs now and y_before one
    step ago, at the start the same as now. Without `sees_outputs` y and y_before are not computed.
    """

    function: Any
    numbers: Array
    sees_outputs: bool


class Setup(NamedTuple):
    """Functions, or the addresses of compiled ones, and arrays of a roll-out.

    kind: 0 for held points, 1 for dynamics, 2 for dynamics that see the `named` outputs
    steps (T,) rising: after which steps the selected outputs (l,) are written, to outputs (S, T l); NaN from where a
        point diverges
    begin (S,): the steps that a point has in common with the first point, which are not computed again
    limits (3, m): minimum, maximum and largest change per step of the control
    points (S, p); applied (m,): the control now applied; first (S, m): the control on the first step
    scratch: x (n,), control and wanted (m,), y and y_before (named,), states and controls of the first point at each
        step (N + 1, n) and (N + 1, m)
    """

    step: Any
    outputs_of: Any
    parameters: Any
    dynamics: Any
    numbers: Array
    kind: int
    steps: Integers
    selected: Integers
    begin: Integers
    limits: Array
    applied: Array
    points: Array
    outputs: Array
    first: Array
    x: Array
    control: Array
    wanted: Array
    y: Array
    y_before: Array
    states: Array
    controls: Array


@program
def roll_out(state: Array, preview: Array, setup: Setup, out: Array) -> None:
    """Drive the model with the points of a setup from state (n,)."""
    step, outputs_of, parameters, dynamics = setup.step, setup.outputs_of, setup.parameters, setup.dynamics
    kind, steps, limits = setup.kind, setup.steps, setup.limits
    applied, points, outputs, first = setup.applied, setup.points, setup.outputs, setup.first
    x, control, wanted, y, y_before = setup.x, setup.control, setup.wanted, setup.y, setup.y_before
    states, controls = setup.states, setup.controls
    n, m, chosen = x.shape[0], control.shape[0], setup.selected.shape[0]
    last = steps[steps.shape[0] - 1]
    for a in range(n):
        states[0, a] = state[a]
    for c in range(m):
        controls[0, c] = applied[c]
    for i in range(points.shape[0]):
        start = setup.begin[i]
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
            for k in range(y.shape[0]):
                y_before[k] = y[k]
        for j in range(start, last):
            if kind == 0:
                for c in range(m):
                    wanted[c] = points[i, c]
            else:
                call(dynamics, (points[i], control, x, y, y_before, preview, j, setup.numbers, wanted))
            finite = True
            for c in range(m):
                finite &= abs(wanted[c]) < np.inf
            limit(wanted, limits, control)
            if j == 0:
                for c in range(m):
                    first[i, c] = control[c]
            if finite:
                call(step, (x, control, parameters, x))
            for a in range(n):
                # A comparison, because the compiler may fold np.isfinite (x - x == 0) of a sum.
                finite &= abs(x[a]) < np.inf
            if not finite:
                break
            if i == 0:
                for a in range(n):
                    states[j + 1, a] = x[a]
                for c in range(m):
                    controls[j + 1, c] = control[c]
            if kind == 2:
                for k in range(y.shape[0]):
                    y_before[k] = y[k]
            if kind == 2 or j + 1 == steps[taken]:
                call(outputs_of, (x, parameters, y))
            if j + 1 == steps[taken]:
                for k in range(chosen):
                    outputs[i, taken * chosen + k] = y[setup.selected[k]]
                taken += 1


class RollOut:
    """The roll-out of a model, for one thread: compiled if the model is, else the same text interpreted.

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
        n, m = model.state_size, limits.shape[1]
        self.points, self.first, self.applied = np.empty(points), np.empty((points[0], m)), np.empty(m)
        self.outputs = np.empty((points[0], len(steps) * len(selected)))
        self.begin = np.zeros(points[0], dtype=np.int64)
        self.cause, self._made_of = "", (model, limits, dynamics)
        self._setup = Setup(
            model.step,
            model.outputs,
            model.parameters,
            None if dynamics is None else dynamics.function,
            np.zeros(1) if dynamics is None else dynamics.numbers,
            0 if dynamics is None else 1 + dynamics.sees_outputs,
            np.array(steps, dtype=np.int64),
            np.array(selected, dtype=np.int64),
            self.begin,
            limits,
            self.applied,
            self.points,
            self.outputs,
            self.first,
            np.empty(n),
            np.empty(m),
            np.empty(m),
            np.empty(named),
            np.empty(named),
            np.empty((steps[-1] + 1, n)),
            np.empty((steps[-1] + 1, m)),
        )
        self._compiled = self._addresses()
        self._run: Callable[[Array, Array, Array], None] | None = None

    def __call__(self, state: Array, applied: Array, preview: Array) -> None:
        """Write `outputs` (S, T l) and `first` (S, m) of `points` (S, p) from a state and the control now applied."""
        if self._run is None:
            self._run = self.between(None, None, (), state, preview, applied)
        self.applied[:] = applied
        self._run(state, preview, self.applied)

    def paths(self, state: Array, preview: Array, steps: int) -> tuple[Array, Array]:
        """States (S, steps + 1, n) of the model from a state under `points`, and the last controls (S, m).

        The control now applied is that of the roll-out before. preview: as many rows as the dynamics take in so many
        steps. A point that diverges is NaN from there on.
        """
        model, limits, dynamics = self._made_of
        one = RollOut(model, len(self._setup.y), [steps], [], limits, (1, self.points.shape[1]), dynamics)
        found = []
        for point in self.points:
            one.points[0], one._setup.states[:] = point, np.nan
            one(state, self.applied, preview)
            found.append((one._setup.states.copy(), one._setup.control.copy()))
        states, controls = zip(*found, strict=True)
        return np.array(states), np.array(controls)

    def between(
        self, before: Any, after: Any, numbers: Any, *example: Array
    ) -> Callable[[Array, Array, Array], None]:
        """The roll-out between two programs (state, preview, numbers, out), in one call (state, preview, out)."""
        first, last = ([(text, numbers)] if text else [] for text in (before, after))
        compiled: Callable[..., None] | None = None
        if self._compiled is not None:
            compiled = by_address([*first, (roll_out, self._compiled[1]), *last], *example)
        in_python: list[tuple[Any, Any]] = []

        def run(state: Array, preview: Array, out: Array) -> None:
            self.cause = ""
            if compiled is not None:
                try:
                    compiled(state, preview, out)
                except NumbaError as error:  # of an array that machine code does not take
                    raise ValueError(f"{one_line(error)}.") from error
                except (*LEFT_ITS_DOMAIN, *MISTAKES):
                    pass  # Compiled code cannot go on with the other points: the same again from Python.
                else:
                    return
            if not in_python:
                for text, its_numbers in [*first, (roll_out, self._setup), *last]:
                    same = interpreted(text, call=self._guarded)
                    in_python.append((same, its_numbers))
            with np.errstate(all="ignore"):
                for function, its_numbers in in_python:
                    function(state, preview, its_numbers, out)

        return run

    def _addresses(self) -> tuple[InMemory, Setup] | None:
        """The model's numbers in memory, and the setup with addresses of compiled functions, if all are jitted."""
        at = self._setup
        functions = [at.step, at.outputs_of] + ([] if at.dynamics is None else [at.dynamics])
        if not all(map(is_jitted, functions)):
            return None
        state, control, y, where = at.x, at.control, at.y, 0
        if at.dynamics is not None:
            example = (self.points[0], control, state, y, y, np.empty((1, 1)), 0, at.numbers, control)
            where = _compiled(at.dynamics, *example)
        placed = InMemory(at.parameters)
        return placed, at._replace(
            step=_compiled(in_memory(at.step), state, control, placed, state),
            outputs_of=_compiled(in_memory(at.outputs_of), state, placed, y),
            parameters=placed.address,
            dynamics=where,
        )

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
