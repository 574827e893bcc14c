# SPDX-License-Identifier: Apache-2.0
"""Decisions at recorded states, without a plant."""

import numpy as np
from pendulums import DT_S, filter_of, pendulum, reading
from runs import cart

from skydiver_utc.controllers.open_loop import OpenLoop
from skydiver_utc.controllers.settings import OpenLoopSettings
from skydiver_utc.loop.build import build_controller, build_disturbances, build_estimator, build_reference
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.loop.decisions import Decider, Stretch, decide_at
from skydiver_utc.parameters import override


def test_another_controller_in_flight_leaves_the_estimate_as_it_is() -> None:
    plant = pendulum()
    estimator = filter_of(plant)
    decider = Decider(OpenLoop(OpenLoopSettings(), plant, ("torque",), DT_S), estimator, plant)
    decider.begin()
    for k in range(10):
        decider.decide(k, [reading(k, 0.4)], np.zeros((1, 1)))
        decider.predict()
    before = estimator.covariance
    assert before[0, 0] < 0.5 * 0.2**2
    decider.begin(np.array([0.1]))
    np.testing.assert_array_equal(estimator.covariance, before)
    decider.begin()
    assert estimator.covariance[0, 0] == 0.2**2


def test_a_recording_that_lacks_the_beginning_has_the_errors_of_its_own_steps() -> None:
    noise = {"kind": "measurement_error", "noise": {"place": 0.1}, "drift": {"speed": 0.2}}
    scenario = override(cart(), {"controller": {"kind": "lqr"}, "disturbances": [noise]})
    run, reference = simulate(scenario), build_reference(scenario)
    first = 17
    decider = Decider(
        build_controller(scenario, run.plant, reference),
        build_estimator(scenario, run.plant),
        run.plant,
        build_disturbances(scenario, run.plant),
    )
    stretches = [Stretch(0, decider, run.applied[first - 1])]
    preview = reference.preview(first, 300)
    found = decide_at(stretches, first, run.states[first:-1], 1, preview)
    np.testing.assert_array_equal(found, run.commands[first:])
