# SPDX-License-Identifier: Apache-2.0
"""A flight that is changed as it goes on."""

import numpy as np
import pytest
from runs import cart, run_of, skydiver

from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.loop.outcome import Outcome
from skydiver_utc.parameters import ParameterError, load_scenario, override
from skydiver_utc.view.live_controls import label, settings_to_change, slider_range
from skydiver_utc.view.live_flight import LiveFlight
from skydiver_utc.view.recorded_flight import RecordedFlight


@pytest.fixture(scope="module")
def flight():
    """The fast turn with UTC; a test begins with `reset`."""
    return LiveFlight(load_scenario("fast_turn_unknown_dynamics"))


def yaw_rate(flight):
    return flight.now().state[12]


def test_unchanged_it_is_the_simulated_run_until_a_setting_moves_the_body(flight):
    scenario = load_scenario("fast_turn_unknown_dynamics", {"duration_s": 1.0})
    flight.reset()
    flight.advance(1.0)
    run = simulate(scenario)
    np.testing.assert_array_equal(flight.now().state, run.states[-1])
    recorded = RecordedFlight(run, "recorded")
    recorded.seek(recorded.ends_s)
    alpha = run.telemetry[-1, run.telemetry_names.index("std_alpha")]
    assert [each.signals.deviations(each.now())[3] for each in (flight, recorded)] == [alpha, alpha]

    flight.change({"reference.amplitude_deg_s": 100.0})
    flight.advance(1.0)
    assert abs(yaw_rate(flight)) < np.deg2rad(110.0)
    flight.change({"reference.amplitude_deg_s": 400.0})


@pytest.mark.parametrize(
    ("name", "value"),
    [("controller.P_err", 1.1e-4), ("controller.horizon_steps", 22), ("controller.coupling.alpha", 0.5)],
)
def test_the_controller_goes_on_from_the_control_in_force(flight, name, value):
    flight.reset()
    flight.advance(0.5)
    before = flight.now().applied
    flight.change({name: value})
    flight.advance(0.9 * flight.scenario.dt_s)
    assert abs(flight.now().applied[3] - before[3]) <= flight.plant.rate[3] * flight.scenario.dt_s * (
        1 + 1e-9
    )
    flight.advance(1.5)
    assert not flight.ended
    assert yaw_rate(flight) == pytest.approx(flight.now().reference[0], abs=1.0)


def test_a_wrong_setting_is_named_and_changes_nothing(flight):
    flight.reset()
    before = flight.scenario
    for name in ("reference.frequency_hz", "controller.P_err"):
        with pytest.raises(ParameterError, match=name.split(".")[1]):
            flight.change({name: -1.0})
    assert flight.scenario is before


def test_a_gust_and_a_push_move_the_body_until_reset(flight):
    def flown(act):
        flight.reset()
        flight.advance(0.3)
        act()
        flight.advance(0.7)
        return flight.now()

    still, blown = flown(lambda: None), flown(flight.blow)
    pushed = flown(lambda: flight.push("wz", 1.0))
    assert np.linalg.norm(blown.wind) > 1.0
    assert abs(blown.state[12] - still.state[12]) > np.deg2rad(0.1)
    assert not np.array_equal(pushed.state, still.state)
    np.testing.assert_array_equal(flown(lambda: None).state, still.state)


def test_the_ghost_ends_where_the_held_command_takes_the_body(flight):
    flight.reset()
    flight.advance(1.0)
    states, applied = flight.look_ahead()
    horizon = load_scenario("fast_turn_unknown_dynamics").controller.horizon_steps
    assert len(states) == 2 * len(flight.plant.control_names) + 1
    assert len(applied) == len(states)
    further, _ = flight.look_ahead(0.5)
    assert further.shape[1] == 1 + round(0.5 / flight.scenario.dt_s) > horizon
    spread = np.ptp(states[:, -1, 12])
    now = flight.now().state
    flight.advance(0.99 * flight.scenario.dt_s)
    np.testing.assert_array_equal(states[:, 0], np.tile(now, (len(states), 1)))
    assert spread > 0.0
    assert np.abs(states[0, 1] - flight.now().state).max() < 0.02


def test_a_plant_without_a_wind_has_no_gust_and_other_controllers_predict_their_command():
    lqr = {"controller": {"kind": "lqr"}}
    flight = LiveFlight(override(cart(), lqr))
    flight.advance(0.5)
    assert flight.gusts.settings is None
    assert not any("deviation" in chart.title for chart in flight.signals.charts())
    states, _ = flight.look_ahead()
    assert np.isfinite(states).all()


def test_a_recording_has_the_wind_that_is_in_it_and_needs_a_step():
    wind = np.zeros((81, 3))
    wind[40:, 1] = 7.0
    run = run_of(scenario=skydiver(), disturbance=wind, disturbance_names=("wind_x", "wind_y", "wind_z"))
    flight = RecordedFlight(run, "anna")
    flight.seek(run.time_s[50])
    assert flight.now().wind.tolist() == [0.0, 7.0, 0.0]
    with pytest.raises(ParameterError, match="anna"):
        RecordedFlight(run_of(steps=0, outcome=Outcome.NO_COMMAND), "anna")


def test_each_number_of_a_setting_has_a_range_that_it_may_take():
    scenario = load_scenario("fast_turn_pi_dynamics")
    leaves = list(settings_to_change(scenario))
    names = {leaf.name for leaf in leaves}
    assert {
        "reference.amplitude_deg_s",
        "reference.frequency_hz",
        "controller.horizon_steps",
        "controller.P_err",
        "controller.Pu.alpha",
        "controller.coupling.k_left",
    } <= names
    for leaf in leaves:
        if type(leaf.value) in (int, float) and (span := slider_range(leaf)) is not None:
            low, high, step = span
            assert low <= leaf.value <= high, leaf
            assert leaf.minimum is None or leaf.minimum <= low, leaf
            assert leaf.maximum is None or high <= leaf.maximum, leaf
            assert step > 0, leaf
    (amplitude,) = (leaf for leaf in leaves if leaf.name == "reference.amplitude_deg_s")
    assert label(amplitude) == "amplitude [deg/s]"
