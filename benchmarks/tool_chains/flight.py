"""Each tool chain flies the skydiver itself, from a point in UTC's flight on, and is timed on its way."""

import time
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
from timing import Subject

from skydiver_utc.parameters import Scenario
from skydiver_utc.simulation.build import build_plant, build_reference
from skydiver_utc.simulation.closed_loop import simulate
from tool_chains.ipopt import decide_by_ipopt
from tool_chains.model import reduced
from tool_chains.real_time import decide_by_osqp
from tool_chains.task import Decide, Task, task
from tool_chains.with_do_mpc import decide_by_do_mpc

_START = 300
_CHAINS: dict[str, Callable[[Task], Decide]] = {
    "CasADi + IPOPT": decide_by_ipopt,
    "CasADi + IPOPT, expanded": partial(decide_by_ipopt, expand=True),
    "do-mpc": decide_by_do_mpc,
    "real-time iteration, CasADi + OSQP": decide_by_osqp,
}


def tool_chains(scenario: Scenario) -> Iterator[Subject]:
    """One subject per tool chain, with the horizon of a scenario that UTC flies."""
    flight, wanted = simulate(scenario), task(scenario)
    for name, make in _CHAINS.items():
        once = _decision(
            scenario, make(wanted), wanted.steps, flight.states[_START], flight.applied[_START - 1]
        )
        yield Subject(name, once)


def _decision(
    scenario: Scenario, decide: Decide, steps: int, state: np.ndarray, applied: np.ndarray
) -> Callable[[], float]:
    """One decision along the chain's own flight [s]."""
    plant = build_plant(scenario)
    profile = build_reference(scenario).preview(0, scenario.steps + steps + 1)
    held, k = np.append(applied, 0.0), _START

    def once() -> float:
        nonlocal state, held, k
        begin = time.process_time()
        control = decide(reduced(state), held[:4], profile[k + 1 : k + steps + 1])
        taken = time.process_time() - begin
        before, held = held, plant.actuate(control, held)
        state = plant.step(state, before, held)
        k += 1
        return taken

    return once
