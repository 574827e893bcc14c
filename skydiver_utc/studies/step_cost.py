"""What one decision of UTC costs beside the solution of a nonlinear program on the same prediction."""

import time

import msgspec
import numpy as np

from skydiver_utc.parameters import load_scenario
from skydiver_utc.simulation.build import build_controller, build_reference
from skydiver_utc.simulation.closed_loop import simulate
from skydiver_utc.studies.paper_runs import M0_C2

_SECONDS, _IN_A_ROW = 2.0, 20
_HELD, _EVERY_STEP = "fast_turn_gauss_newton_held", "fast_turn_gauss_newton"


class StepCost(msgspec.Struct, frozen=True):
    """Processor time of one Gauss-Newton iteration as a multiple of UTC's decision, both 20 steps ahead.

    held: for one control over the horizon, which is what UTC finds; every_step: for a control of each step.
    """

    held: float
    every_step: float


def step_cost() -> StepCost:
    """Median times at the states of UTC's own flight, some decisions of each controller in turn."""
    flight = simulate(M0_C2.load(_SECONDS))
    controllers = [
        build_controller(one)
        for one in (
            flight.scenario,
            load_scenario(_HELD),
            load_scenario(_EVERY_STEP, {"controller.blocks": 20}),
        )
    ]
    width = 1 + max(controller.preview_steps for controller in controllers)
    profile = build_reference(flight.scenario).preview(0, len(flight.states) + width)
    taken: list[list[float]] = [[] for _ in controllers]
    for begin in range(0, len(flight.commands) - _IN_A_ROW, _IN_A_ROW):
        for times, controller in zip(taken, controllers, strict=True):
            for k in range(begin, begin + _IN_A_ROW):
                preview = profile[k : k + controller.preview_steps + 1]
                start = time.process_time()
                controller.decide(flight.states[k], preview)
                times.append(time.process_time() - start)
    # The first turn compiles.
    utc, held, every_step = (float(np.median(times[_IN_A_ROW:])) for times in taken)
    return StepCost(held=float(f"{held / utc:.2g}"), every_step=float(f"{every_step / utc:.2g}"))
