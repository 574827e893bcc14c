# SPDX-License-Identifier: Apache-2.0
"""Differences between the scenario of a controller's node and the recorded one."""

from runs import cart

from skydiver_utc.loop.tuned_scenario import TunedScenario
from skydiver_utc.parameters import leaves, override, to_yaml


def test_all_that_decides_on_a_command_is_a_difference() -> None:
    noisy = override(cart(), {"disturbances": [{"kind": "measurement_error", "noise": {"speed": 0.1}}]})
    own = {"seed": 4, "disturbances.0.noise.speed": 0.2, "plant.minimum": [-2.0]}
    tuned = TunedScenario(override(noisy, own | {"duration_s": 2.0}), 0)
    assert tuned.compare(to_yaml(noisy))
    assert tuned.changes == own
    assert own.keys() <= {leaf.name for leaf in leaves(noisy)}
