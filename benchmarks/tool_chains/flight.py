# SPDX-License-Identifier: Apache-2.0
"""Each tool chain flies the skydiver from a point in a flight of the package on, and is timed on its way."""

import time
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
from timing import Subject

from skydiver_utc.loop.build import build_plant, build_reference
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.loop.run import Run
from skydiver_utc.parameters import Scenario, load_scenario
from tool_chains.chains import controller_by
from tool_chains.ipopt import solve_by_ipopt, solve_by_opti
from tool_chains.program import Program, Solve
from tool_chains.real_time import solve_by_osqp
from tool_chains.with_do_mpc import solve_by_do_mpc

_START = 300
_DURATION_S = 5.0
_HELD, _EACH = "fast_turn_gauss_newton_held", "fast_turn_gauss_newton"
# Whose costs, whether one control is held over the horizon, and what solves.
_CHAINS: dict[str, tuple[str, Callable[[Program], Solve]]] = {
    "CasADi + IPOPT, a control for every step": (_EACH, solve_by_opti),
    "the same, expanded": (_EACH, partial(solve_by_opti, expand=True)),
    "do-mpc, a control for every step": (_EACH, partial(solve_by_do_mpc, compiled=False)),
    "CasADi + OSQP, real-time iteration, compiled, a control for every step": (_EACH, solve_by_osqp),
    "CasADi + IPOPT, compiled, one held control": (_HELD, solve_by_ipopt),
    "do-mpc, compiled, one held control": (_HELD, solve_by_do_mpc),
    "CasADi + OSQP, real-time iteration, compiled, one held control": (_HELD, solve_by_osqp),
}


def tool_chains(steps: int) -> Iterator[Subject]:
    """One subject per tool chain, with this many model steps in the horizon."""
    flights = {name: simulate(_scenario(name, steps)) for name in (_HELD, _EACH)}
    for label, (name, solve) in _CHAINS.items():
        yield Subject(label, _decision(flights[name], solve))


def _scenario(name: str, steps: int) -> Scenario:
    blocks = 1 if name == _HELD else steps
    return load_scenario(
        name, {"duration_s": _DURATION_S, "controller.horizon_steps": steps, "controller.blocks": blocks}
    )


def _decision(flight: Run, solve: Callable[[Program], Solve]) -> Callable[[], float]:
    """One decision along the chain's own flight [s]."""
    scenario = flight.scenario
    plant, reference = build_plant(scenario), build_reference(scenario)
    controller = controller_by(solve)(scenario, plant, reference)
    profile = reference.preview(0, scenario.steps + controller.preview_steps + 1)
    state, held, k = flight.states[_START], np.append(flight.applied[_START - 1], 0.0), _START
    controller.resume(held[:4])

    def once() -> float:
        nonlocal state, held, k
        preview = profile[k : k + controller.preview_steps + 1]
        begin = time.process_time()
        decision = controller.decide(state, preview)
        taken = time.process_time() - begin
        state, held = plant.advance(state, held, decision.control)
        k += 1
        return taken

    return once
