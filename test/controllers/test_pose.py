# SPDX-License-Identifier: Apache-2.0
"""The pose controller against eq:lim, and its damping against the model's steady turns."""

import numpy as np
import paper_utc as paper
from skydivers import parts_of

from skydiver_utc.parameters import load_scenario
from skydiver_utc.plants.skydiver.steady import steady_turns, straight_falls


def parts(**pose):
    settings = {f"controller.{name}": value for name, value in pose.items()}
    plant, _, controller = parts_of(load_scenario("fast_turn_pose_only", settings))
    return plant, controller


def test_it_equals_eq_lim():
    rng = np.random.default_rng(0)
    _, controller = parts()
    previous = 0.0
    for _ in range(500):
        state = np.zeros(13)
        state[6], state[12] = 1.0, rng.normal(0, 3)
        r = rng.normal(0, 3)
        control = controller.decide(state, np.array([[r]])).control
        previous = paper.pose_controller(r, float(state[12]), previous, 0.0042)
        np.testing.assert_allclose(control, [0.5, 0.0, 0.0, previous], rtol=1e-14)


def test_the_damping_fed_forward_is_that_of_the_steady_turn():
    """At the largest feed-forward the model's steady turn has the reference's yaw rate, for falling damping."""
    most, constant = 1.0, 0.5
    model = parts()[0].constants
    fall = straight_falls(model)[0]

    def steady(damping):
        (turn,) = steady_turns(model, fall, np.array([most]), damping)
        return turn.yaw_rate

    _, controller = parts(
        K_p=0.0, K_FF=most / steady(constant), Cm_damp_yaw=constant, alpha_feed_forward_max=most
    )
    state = np.zeros(13)
    state[6] = 1.0
    assert controller.decide(state, np.array([[0.9 * steady(constant)]])).control[0] == constant
    for damping in (0.3, 0.2, 0.1, 0.05):
        fed = controller.decide(state, np.array([[steady(damping)]])).control[0]
        np.testing.assert_allclose(fed, damping, atol=0.01)
