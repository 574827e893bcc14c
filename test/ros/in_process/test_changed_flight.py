# SPDX-License-Identifier: Apache-2.0
"""A flight over ROS that its page changes: sliders, ghost, push, gust, pause and reset; the bag has all of it."""

from pathlib import Path

import numpy as np
import pytest
from child_processes import PATIENCE_S, wait_until
from ros_fixtures import Ros, overrides, spinning

from skydiver_utc.analysis.controller_check import check
from skydiver_utc.analysis.recorded_run import RecordedRun
from skydiver_utc.loop.plant_steps import PlantSteps
from skydiver_utc.messages import read_state
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.observed_run import ObservedRun
from skydiver_utc.parameters import ParameterError
from skydiver_utc.rotations import turn_into_world
from skydiver_utc.view.live_controls import LivePage
from skydiver_utc.view.live_flight import LiveFlight
from skydiver_utc.view.ros_flight import RosFlight

pytest_plugins = ("ros_fixtures",)


@pytest.mark.long
def test_sliders_ghost_push_and_gust_reach_the_flight_and_the_bag(ros: Ros, tmp_path: Path) -> None:
    given = overrides(6.0)
    recorder = ros.node("recorder", given | {"out": str(tmp_path / "bag")})
    plant, controller, _ = ros.start(given | {"wait_for_recorder": True}, "plant", "controller", "reference")
    with spinning(ros):
        observed = ObservedRun("skydiver", PATIENCE_S, ros.context)
        observed.pause(True)
        flight = RosFlight(observed)
        wait_until(lambda: flight.now().time_s == plant.k * plant.scenario.dt_s)
        stands_at = plant.k

        # The ghost is where the model goes under the applied command; its spread that of a flight in this process.
        ghost, held = flight.look_ahead(0.3)
        control, state = flight.now().applied[:4], flight.now().state
        np.testing.assert_array_equal(held[0, :4], control)
        for predicted in ghost[0]:
            np.testing.assert_array_equal(predicted, state)
            flight.plant.bound_model.step(state.copy(), control, state)
        beside = LiveFlight(plant.scenario)
        beside.advance((stands_at - 0.5) * plant.scenario.dt_s)
        expected, _ = beside.look_ahead(0.3)
        assert ghost.shape == expected.shape
        spread, expected_spread = (np.ptp(each[:, -1, 12]) for each in (ghost, expected))
        assert spread == pytest.approx(expected_spread, rel=0.5)

        assert flight.changes == ("controller",)
        page = LivePage(flight, port=8196)
        page.playing = False
        assert not any(name.startswith("reference.") for name in page.handles)
        for name, value, kept in (
            ("controller.P_err", 2e-4, 2e-4),
            ("controller.P_err", -1.0, 2e-4),
            ("controller.horizon_steps", 500, 20),  # further than the reference is published
        ):
            page.handles[name].value = value
            page.frame(0.0)
            assert page.handles[name].value == controller.get_parameter(name).value == kept
        page.stop()
        with pytest.raises(ParameterError, match="reference"):
            flight.change({"controller.horizon_steps": 500})
        assert RosFlight(observed).scenario == flight.scenario  # of a page that is opened later

        flight.push("wz", 1.0)
        flight.blow()
        assert plant.k == stands_at
        observed.pause(False)
        put_back = False
        while not plant.done:
            flight.advance(0.01)
            if not put_back and flight.now().time_s > 4.0:
                flight.reset()
                put_back = True
            wait_until(lambda: plant.done or flight.now().time_s > flight.history()[-1][0])
        wait_until(lambda: recorder.done)
    ros.remove(controller)
    with spinning(ros), pytest.raises(ParameterError, match="skydiver"):
        flight.change({"controller.P_err": 1e-4})
    observed.close()
    assert recorder.close() == 0
    recording = RecordedRun(tmp_path / "bag")
    run, checked = recording.run(), check(recording)
    assert checked.equal
    assert [change.of_scenario for change in run.changes] == [{"controller.P_err": 2e-4}]
    pushes = dict(zip(run.disturbance_names, run.disturbance.T, strict=True))
    (back,) = np.flatnonzero(pushes["push_z"])
    np.testing.assert_allclose(run.states[back], run.plant.initial_state(), atol=1e-12)
    assert np.flatnonzero(pushes["push_wz"]).tolist()[1:] == [back]
    assert pushes["push_wz"].tolist().count(1.0) == 1
    gust = np.zeros((len(run.states), 3))  # in the world
    for row, state, total in zip(
        np.column_stack([pushes[f"push_v{c}"] for c in "xyz"]), run.states, gust, strict=True
    ):
        turn_into_world(state[3:7], row, total)
    gust = np.cumsum(gust[:back], axis=0)
    assert np.abs(gust).max() > 1.0
    # What is recorded flies again, bit for bit.
    again = PlantSteps(run.scenario)
    again.begin()
    for k, command in enumerate(run.commands):
        change = np.array([pushes.get(f"push_{n}", np.zeros(k + 2))[k + 1] for n in run.plant.state_names])
        if change.any():
            again.push(change)
        again.step(command)
        np.testing.assert_array_equal(again.state, run.states[k + 1])


def test_a_push_acts_at_the_next_step_and_one_of_a_place_is_refused(ros: Ros) -> None:
    plant, *_ = ros.start(overrides(0.5, mode="real_time"), "plant", "controller", "reference")
    partner = ros.partner()
    states, pushed = partner.receive(topics.STATE), partner.receive(topics.PUSHED)
    push = partner.publisher(topics.PUSH)
    ros.spin_until(lambda: push.get_subscription_count())
    for name in ("z", "nothing"):
        push.publish(topics.PUSH.type(name=[name], position=[1.0]))
    ros.spin_until(lambda: plant.refusals.counts["names"] == 2)
    push.publish(topics.PUSH.type(name=["wx"], position=[3.0]))
    ros.spin_until(lambda: plant.done and len(states) > plant.k and pushed)
    (found,) = pushed
    at = plant.grid.step_of(found.header.stamp)
    rates = [read_state(message, found.name)[10] for message in states]
    assert rates[at] - rates[at - 1] == pytest.approx(3.0, abs=0.5)
