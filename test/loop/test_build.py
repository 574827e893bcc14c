# SPDX-License-Identifier: Apache-2.0
"""What is known of a slot without building what stands in it."""

import pytest

from skydiver_utc.loop.build import build_controller, build_plant, build_reference, preview_steps
from skydiver_utc.parameters import load_scenario


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("fast_turn_pose_only", {}),
        ("fast_turn_lqr", {}),
        ("fast_turn_gauss_newton", {"controller.step_periods": 3}),
        ("fast_turn_mppi", {}),
        ("fast_turn_unknown_dynamics", {}),
        ("fast_turn_unknown_dynamics", {"controller.coupling.k_hyst_s": 0.01}),
        ("fast_turn_pi_dynamics", {"controller.dynamics.tau_s": 3.0}),
    ],
)
def test_the_steps_that_a_controller_looks_ahead(name, changes):
    scenario = load_scenario(name, changes)
    controller = build_controller(scenario, build_plant(scenario), build_reference(scenario))
    assert preview_steps(scenario) == controller.preview_steps
