# SPDX-License-Identifier: Apache-2.0
"""Delay compensation against the plant itself: with a perfect model the prediction is the state to come."""

from collections import deque
from typing import Any

import numpy as np
import pytest

from skydiver_utc.controllers.delay import DelayCompensation
from skydiver_utc.controllers.protocol import Decision, Status
from skydiver_utc.loop.build import build_controller, build_plant, build_reference
from skydiver_utc.parameters import load_scenario

SCENARIO = "fast_turn_unknown_dynamics"


class Spy:
    """Asks for a moving control and remembers the state and preview that it was shown."""

    preview_steps = 3
    telemetry_names = ()

    def __init__(self) -> None:
        self.shown: list[Any] = []
        self.resumed: Any = None

    def reset(self) -> None:
        pass

    def resume(self, control: Any) -> None:
        self.resumed = control

    def decide(self, state: Any, preview: Any) -> Decision:
        self.shown.append((state.copy(), preview.copy()))
        alpha = np.sin(0.05 * len(self.shown))
        return Decision(np.array([3.0, 0.2, 0.1, alpha]), np.empty(0), Status.SOLVED)


@pytest.mark.parametrize("delay", [1, 2, 5])
def test_the_controller_decides_on_the_state_to_come(delay: int) -> None:
    """In a flight in which the command for k acts on [t_k+delay, t_k+delay+1)."""
    scenario = load_scenario(SCENARIO, {"duration_s": 1.0})
    plant, reference, spy = build_plant(scenario), build_reference(scenario), Spy()
    controller = DelayCompensation(spy, plant, delay)
    assert controller.preview_steps == spy.preview_steps + delay
    state, held = plant.initial_state(), plant.initial_applied()
    states, waiting = [state], deque([held[:4]] * delay)
    for k in range(scenario.steps):
        waiting.append(controller.decide(state, reference.preview(k, controller.preview_steps + 1)).control)
        state, held = plant.advance(state, held, waiting.popleft())
        states.append(state)
    for k, (shown, preview) in enumerate(spy.shown[: scenario.steps - delay]):
        assert shown.tobytes() == states[k + delay].tobytes()
        assert preview.tobytes() == reference.preview(k + delay, spy.preview_steps + 1).tobytes()


def test_after_resuming_the_held_control_is_that_of_the_flight() -> None:
    plant, spy, held = build_plant(load_scenario(SCENARIO)), Spy(), np.array([4.0, 0.3, 0.0, 0.5])
    controller, state = DelayCompensation(spy, plant, 2), plant.initial_state()
    controller.resume(held)
    controller.decide(state, np.zeros(6))
    before = np.append(held, 0.0)
    for _ in range(2):
        state, before = plant.advance(state, before, held)
    assert spy.shown[0][0].tobytes() == state.tobytes()
    assert spy.resumed.tolist() == held.tolist()


def test_the_scenarios_controller_with_a_delay_looks_further_ahead() -> None:
    scenario = load_scenario(SCENARIO)
    plant, reference = build_plant(scenario), build_reference(scenario)
    plain, delayed = (build_controller(scenario, plant, reference, delay_steps=d) for d in (0, 3))
    assert delayed.preview_steps == plain.preview_steps + 3
