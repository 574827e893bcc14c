# SPDX-License-Identifier: Apache-2.0
"""UTC as a library on plants that are no skydiver: two-link arm, stirred tank reactor, a ship's heading.

Each is steered from one constant reference to another; the results say what happened.
"""

from typing import Any, NamedTuple

import numpy as np
import pytest
from textbook_plants import TextbookPlant

from skydiver_utc import Status, UnscentedTransformController, UtcSettings

FINE = {Status.SOLVED, Status.SATURATED}
ARM = {"horizon_steps": 5, "P_err": 1e-4, "Qu_ratio": 0.01}
REACTOR = {"horizon_steps": 10, "P_err": 1e-4, "Qu_ratio": 0.01}
SHIP = {"horizon_steps": 5, "P_err": 1e-4}
ANGLES, CONCENTRATION = np.array([1.0, -0.5]), np.array([0.6])


class Flight(NamedTuple):
    states: np.ndarray
    controls: np.ndarray
    results: list[Any]

    @property
    def statuses(self):
        return {result.status for result in self.results}


def ship():
    return TextbookPlant("ship", lead=20.0)


def fly(plant, wanted, settings, steps=300, start=None, arrives=1.0, measured=lambda state: state):
    """A flight of UTC; arrives: the share of each control's distance from its initial value that does."""
    controller = UnscentedTransformController(UtcSettings(**settings), plant)
    state, rest = plant.initial_state() if start is None else np.array(start), plant.initial_control()
    states, controls, results, before = [state], [], [], rest
    for _ in range(steps):
        results.append(controller.step(measured(state), wanted))
        controls.append(results[-1].control)
        state = plant.step(state, before, rest + arrives * (controls[-1] - rest))
        states.append(state)
        before = controls[-1]
    flight = Flight(np.array(states), np.array(controls), results)
    assert (plant.minimum <= flight.controls).all()
    assert (flight.controls <= plant.maximum).all()
    changes = np.abs(np.diff(np.vstack([rest, flight.controls]), axis=0))
    assert (changes <= plant.rate * plant.dt_s * (1.0 + 1e-12)).all()
    return flight


def test_the_arm_goes_to_new_angles():
    """From (0.5, 0.5) rad to (1, -0.5): within 0.02 rad after 30 steps and for good."""
    flight = fly(TextbookPlant("arm", lead=0.1), ANGLES, ARM)
    assert np.abs(flight.states[30:, :2] - ANGLES).max() < 0.02
    assert np.abs(flight.states[-1] - [*ANGLES, 0.0, 0.0]).max() < 3e-3
    assert flight.statuses <= FINE


def test_the_reactor_goes_to_another_concentration():
    """C_b from 0.81 to 0.6 mol/l by two controls: within 0.003 after 60 steps and for good."""
    flight = fly(TextbookPlant("reactor"), CONCENTRATION, REACTOR)
    assert np.abs(flight.states[60:, 1] - 0.6).max() < 3e-3
    assert flight.statuses <= FINE


def test_the_ship_turns_with_its_rudder_at_its_limits():
    """By 1 rad: settled after 60 steps, the rudder on its bound on the way."""
    flight = fly(ship(), [1.0], SHIP)
    assert np.abs(flight.states[60:, 0] - 1.0).max() < 0.02
    assert abs(flight.states[-1, 0] - 1.0) < 1e-6
    assert (flight.controls == 0.61).any()
    assert flight.results[0].status is Status.SATURATED
    assert flight.results[-1].status is Status.SOLVED


@pytest.mark.parametrize(
    ("name", "lead", "wanted", "settings", "offset"),
    [
        ("arm", 0.3, ANGLES, {"horizon_steps": 10, "P_err": 1e-4}, 0.2),
        ("reactor", 0.0, CONCENTRATION, REACTOR | {"horizon_steps": 20, "Qu_ratio": 0.1}, 0.01),
    ],
    ids=["arm", "reactor"],
)
def test_a_curved_output_has_an_offset_that_the_result_tells_and_an_option_takes_away(
    name, lead, wanted, settings, offset
):
    """Widely spread points: their mean meets the reference, the control's own output does not."""
    plant, y = TextbookPlant(name, lead), TextbookPlant(name).outputs
    mean, of_control = (fly(plant, wanted, settings | {"innovation": kind}) for kind in ("mean", "control"))
    assert np.abs(y(mean.states[-1]) - wanted).max() > offset
    told = mean.results[-1]
    assert np.abs(told.of_control - told.predicted).max() > offset
    assert np.abs(y(of_control.states[-1]) - wanted).max() < 1e-4


def test_a_concentration_beyond_the_reactors_best_is_not_reached():
    """At most 1.1 mol/l of B can be held: at first UTC moves there, then the status says that it comes no nearer."""
    flight = fly(TextbookPlant("reactor"), [1.4], REACTOR | {"innovation": "control"})
    assert {result.status for result in flight.results[:20]} <= FINE
    assert {result.status for result in flight.results[-50:]} == {Status.NOT_REACHED}
    assert flight.states[-1, 1] > 1.0


def wrapped(state):
    """The ship's state as a compass tells it."""
    return np.array([np.angle(np.exp(1j * state[0])), state[1]])


def test_the_ship_turns_across_the_compass_point_where_its_angle_wraps():
    """From 3 rad to -3 rad: 0.28 rad to the left with `angles`, nearly a whole circle without."""
    start = [3.0, 0.0]
    short = fly(ship(), [-3.0], SHIP | {"angles": ("heading",)}, start=start, measured=wrapped)
    np.testing.assert_allclose(short.states[-1, 0], 2.0 * np.pi - 3.0, atol=1e-6)
    assert short.states[:, 0].min() >= 3.0 - 1e-9
    assert short.statuses <= FINE
    long = fly(ship(), [-3.0], SHIP, start=start, measured=wrapped)
    assert long.states[:, 0].min() < 0.0


@pytest.mark.parametrize("share", [0.1, 1.0])
@pytest.mark.parametrize(
    ("name", "lead", "wanted", "settings"),
    [
        ("arm", 0.1, ANGLES, ARM),
        ("reactor", 0.0, CONCENTRATION, REACTOR),
        ("tanks", 0.0, [13.0, 13.5], {"horizon_steps": 10, "P_err": 1e-2}),
    ],
    ids=["arm", "reactor", "tanks"],
)
def test_weaker_controls_leave_no_offset_where_it_is_estimated(name, lead, wanted, settings, share):
    """Four fifths of each control arrive: 0.05 and more off without `offset_share`, below 0.001 with it."""
    plant, y = TextbookPlant(name, lead), TextbookPlant(name).outputs
    settings = settings | {"innovation": "control"}
    off = fly(plant, wanted, settings, arrives=0.8)
    assert np.abs(y(off.states[-1]) - wanted).max() > 0.05
    free = fly(plant, wanted, settings | {"offset_share": share}, arrives=0.8)
    assert np.abs(y(free.states[-1]) - wanted).max() < 1e-3
