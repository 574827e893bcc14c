# SPDX-License-Identifier: Apache-2.0
"""The horizon in CasADi: yaw rates of a control sequence and their derivatives, compiled from generated C.

The same grid as `skydiver_utc/controllers/horizon.py`: over a model step alpha is held at the mean of what it takes
on its even way through the block.
"""

import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path

import casadi as ca
from c_transcription import compile_library, compiler

from tool_chains.model import STATES, step
from tool_chains.program import Structure


def held_control(u: ca.MX, alpha: ca.MX, inside: int, hold: int, periods: ca.MX | int) -> ca.MX:
    """The control (4,) over model step `inside` of the `hold` in a block; alpha is that of the block before."""
    share = (inside * periods + 0.5 * (periods + 1)) / (hold * periods)
    return ca.vertcat(u[:3], alpha + share * (u[3] - alpha))


def block(structure: Structure) -> ca.Function:
    """(state (10,), alpha before, control (4,), periods in a model step) -> (state after, yaw rates (hold,))."""
    follow, hold = step(structure.model), structure.hold
    x, alpha, u, periods = ca.MX.sym("x", STATES), ca.MX.sym("alpha"), ca.MX.sym("u", 4), ca.MX.sym("periods")
    after, rates = x, []
    for inside in range(hold):
        held = held_control(u, alpha, inside, hold, periods)
        after = follow(after, held, structure.model.dt * periods)
        rates.append(after[STATES - 1])
    return ca.Function("block", [x, alpha, u, periods], [after, ca.vertcat(*rates)])


@lru_cache(maxsize=8)
def roll_out(structure: Structure) -> ca.Function:
    """(state, control applied last (4,), U (4, B), periods) -> yaw rates (N,)."""
    x, applied, U, periods = _arguments(structure)
    one, state, alpha, rates = block(structure), x, applied[3], []
    for b in range(structure.blocks):
        state, inside = one(state, alpha, U[:, b], periods)
        alpha = U[3, b]
        rates.append(inside)
    return compiled(ca.Function("roll_out", [x, applied, U, periods], [ca.vertcat(*rates)]))


@lru_cache(maxsize=8)
def linearised(structure: Structure) -> ca.Function:
    """The same arguments -> (yaw rates (N,), their derivatives (N, 4 B) by U, block after block).

    Condensed: each block's own derivatives, multiplied through. The first block starts from a state that is given.
    """
    x, applied, U, periods = _arguments(structure)
    blocks, n = structure.blocks, 4 * structure.blocks
    first, later = _sensitivity(structure, fixed_start=True), _sensitivity(structure, fixed_start=False)
    units = ca.DM.eye(n)
    state, state_moved, rates, rows = x, ca.MX(STATES, n), [], []
    for b in range(blocks):
        own = units[4 * b : 4 * b + 4, :]
        if b == 0:
            state, inside, by = first(x, applied[3], U[:, 0], periods)
            moved = ca.mtimes(by, own)
        else:
            state, inside, by = later(state, U[3, b - 1], U[:, b], periods)
            moved = ca.mtimes(by, ca.vertcat(state_moved, units[4 * b - 1, :], own))
        state_moved = moved[:STATES, :]
        rates.append(inside)
        rows.append(moved[STATES:, :])
    outputs = [ca.vertcat(*rates), ca.densify(ca.vertcat(*rows))]
    return compiled(ca.Function("linearised", [x, applied, U, periods], outputs))


def _sensitivity(structure: Structure, fixed_start: bool) -> ca.Function:
    """A block with the derivatives of (state after, yaw rates) by its control, and by state and alpha before."""
    x, alpha, u, periods = ca.MX.sym("x", STATES), ca.MX.sym("alpha"), ca.MX.sym("u", 4), ca.MX.sym("periods")
    after, rates = block(structure)(x, alpha, u, periods)
    by = ca.jacobian(ca.vertcat(after, rates), u if fixed_start else ca.vertcat(x, alpha, u))
    return ca.Function("first" if fixed_start else "later", [x, alpha, u, periods], [after, rates, by])


def _arguments(structure: Structure) -> tuple[ca.MX, ca.MX, ca.MX, ca.MX]:
    return (
        ca.MX.sym("x", STATES),
        ca.MX.sym("applied", 4),
        ca.MX.sym("U", 4, structure.blocks),
        ca.MX.sym("periods"),
    )


def compiled(function: ca.Function) -> ca.Function:
    """The function from its generated C."""
    with library_of(function.name(), [function]) as library:
        return ca.external(function.name(), library)


@contextmanager
def library_of(name: str, functions: Iterable[ca.Function]) -> Iterator[str]:
    """Path of a library of functions, by the compiler and the flags of c/utc_step.c; removed at the end."""
    if compiler() is None:
        raise RuntimeError(
            "the tool chains are compiled from C that CasADi writes: install a C compiler (cc)"
        )
    with tempfile.TemporaryDirectory() as folder:
        written = ca.CodeGenerator(f"{name}.c")
        for function in functions:
            written.add(function)
        written.generate(f"{folder}/")
        library = Path(folder) / f"{name}.so"
        compile_library(library.with_suffix(".c"), library)
        yield str(library)
