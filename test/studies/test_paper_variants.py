# SPDX-License-Identifier: Apache-2.0
"""The paper's law as transcribed: the package's UTC without variants, and something else under each of them."""

from typing import get_args

import numpy as np
import pytest
from numpy.typing import NDArray

from skydiver_utc.loop.build import build_controller, build_plant, build_reference
from skydiver_utc.parameters import Scenario, load_scenario
from skydiver_utc.studies.paper_cases import PI, PI_Q3, UNKNOWN, VARIANTS
from skydiver_utc.studies.paper_variants import KIND, Variant

STEPS = 40
RIGHT_TURN = 700  # a step at which the turn to the right speeds up
# Of a control; the variants move it by 2e-5 and more.
ROUNDING = 1e-9


def controls(scenario: Scenario, first_step: int = RIGHT_TURN) -> NDArray[np.float64]:
    """Controls (STEPS, 4) of a skydiver who begins at this step with the reference's yaw rate."""
    plant, reference = build_plant(scenario), build_reference(scenario)
    controller = build_controller(scenario, plant, reference)
    state, applied = plant.initial_state(), plant.initial_applied()
    state[12] = reference.preview(first_step, 1)[0, 0]
    found = []
    for k in range(first_step, first_step + STEPS):
        control = controller.decide(state, reference.preview(k, controller.preview_steps + 1)).control
        state, applied = plant.advance(state, applied, control)
        found.append(control)
    return np.array(found)


def transcribed(scenario: str, *variants: str) -> Scenario:
    return load_scenario(scenario, {"controller.kind": KIND, "controller.variants": list(variants)})


@pytest.mark.parametrize("first_step", [0, RIGHT_TURN])
@pytest.mark.parametrize("scenario", [UNKNOWN, PI, PI_Q3])
def test_without_variants_it_is_the_package_s_utc(scenario: str, first_step: int) -> None:
    expected = controls(load_scenario(scenario), first_step)
    np.testing.assert_allclose(controls(transcribed(scenario), first_step), expected, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize(
    ("scenario", "variant"),
    [(PI if name in ("positional", "measured_before") else UNKNOWN, name) for name in get_args(Variant)]
    + [(PI, "saved_at_horizon")],
)
def test_each_variant_gives_other_controls(scenario: str, variant: str) -> None:
    difference = np.abs(controls(transcribed(scenario, variant)) - controls(transcribed(scenario)))
    assert difference.max() > 1e4 * ROUNDING


def test_every_variant_is_in_the_comparison() -> None:
    commands = [one.flown.command for one in VARIANTS if one.flown is not None]
    for name in get_args(Variant):
        assert any(command.endswith(f"controller.variants=[{name}]") for command in commands), name
