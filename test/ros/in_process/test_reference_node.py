# SPDX-License-Identifier: Apache-2.0
"""The reference node: chunks on the grid of steps, setpoints, and a stick."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from own_slots import CART, cart_file
from ros_fixtures import Partner, Ros

from skydiver_utc.loop.build import build_reference
from skydiver_utc.messages import read_named, read_preview
from skydiver_utc.nodes import topics
from skydiver_utc.parameters import to_yaml

pytest_plugins = ("ros_fixtures",)
CHUNK = 20
SINE = "{kind: sine, output: position, amplitude: 0.2, frequency_hz: 2.0}"
LIVE = CART.replace(
    SINE,
    "{kind: live, outputs: {position: linear.x}, initial: {position: 0.5}}",
)


class Stage:
    """A reference node, and a partner that has the clock."""

    def __init__(self, ros: Ros, folder: Path, text: str = CART, **settings: object) -> None:
        self.ros = ros
        given = {"scenario": cart_file(folder, text), "chunk_steps": CHUNK, **settings}
        self.node = ros.node("reference", given)
        self.partner: Partner = ros.partner("own_plant")
        self.clocks = self.partner.publisher(topics.CLOCK)
        self.previews = self.partner.receive(topics.REFERENCE_PREVIEW)
        self.setpoints = self.partner.receive(topics.SETPOINT)
        self.wanted = build_reference(self.node.scenario).preview
        ros.spin_until(lambda: self.clocks.get_subscription_count() and self.previews)

    def tick(self, k: int) -> None:
        """Show a step and wait for its setpoint."""
        before = len(self.setpoints)
        message = topics.CLOCK.type()
        self.node.grid.set_stamp(message.clock, k)
        self.clocks.publish(message)
        self.ros.spin_until(lambda: len(self.setpoints) > before)

    def chunks(self) -> list[tuple[int, Any]]:
        return [read_preview(message, self.node.grid, ("position",)) for message in self.previews]

    def first_steps(self) -> list[int]:
        return [k0 for k0, _ in self.chunks()]


@pytest.fixture
def stage(ros: Ros, tmp_path: Path) -> Stage:
    return Stage(ros, tmp_path)


def test_the_first_chunk_waits_for_a_plant_that_sends_its_clock_and_scenario_and_not_for_subscribers(
    ros: Ros, tmp_path: Path
) -> None:
    """The controller begins with the first chunk, and with it the run."""
    node = ros.node("reference", {"scenario": cart_file(tmp_path, CART)})
    plant = ros.partner("plant")
    previews = plant.receive(topics.REFERENCE_PREVIEW)
    scenarios = plant.publisher(topics.SCENARIO)
    ros.spin_until(scenarios.get_subscription_count)
    clocks = plant.publisher(topics.CLOCK)
    ros.spin_until(clocks.get_subscription_count)
    ros.spin_for(0.2)
    assert not previews
    scenarios.publish(topics.SCENARIO.type(data=to_yaml(node.scenario)))
    ros.spin_until(lambda: previews)
    late = ros.partner("late").receive(topics.REFERENCE_PREVIEW)
    ros.spin_until(lambda: late)
    assert late[0] == previews[0]
    assert node.grid.step_of(late[0].header.stamp) == 0


def test_each_step_has_its_setpoint_and_a_preview_that_covers_what_a_decision_takes(stage: Stage) -> None:
    for k in range(50):
        stage.tick(k)
        assert stage.node.grid.step_of(stage.setpoints[k].header.stamp) == k
        wanted = stage.wanted(k, 1)[0]
        assert read_named(stage.setpoints[k], ("position",)).tobytes() == wanted.tobytes()
        k0, values = stage.chunks()[-1]
        assert k0 <= k
        assert len(values) - (k - k0) >= 4
    assert stage.first_steps() == [0, 20, 40]
    for k0, values in stage.chunks():
        assert values.tobytes() == stage.wanted(k0, len(values)).tobytes()


def test_the_chunk_is_that_of_the_clock_which_may_repeat_itself_or_begin_again(stage: Stage) -> None:
    stage.tick(33)  # it comes into a run
    assert stage.first_steps() == [0, 20]
    stage.tick(33)
    stage.ros.spin_until(lambda: stage.first_steps() == [0, 20, 20])
    stage.tick(0)
    stage.ros.spin_until(lambda: stage.first_steps() == [0, 20, 20, 0])


def test_a_clock_off_the_grid_is_counted(stage: Stage) -> None:
    message = topics.CLOCK.type()
    message.clock.sec = 5
    stage.clocks.publish(message)
    stage.ros.spin_until(lambda: stage.node.refusals.counts == {"stamp": 1})


def stick_message(value: float) -> Any:
    message = topics.STICK.type()
    message.twist.linear.x = value
    return message


def test_a_stick_is_held_from_the_next_step_on(ros: Ros, tmp_path: Path) -> None:
    stage = Stage(ros, tmp_path, LIVE)
    stick = ros.partner("stick").publisher(topics.STICK)
    ros.spin_until(stick.get_subscription_count)
    stage.tick(7)
    stick.publish(stick_message(-0.25))
    ros.spin_until(lambda: stage.first_steps()[-1] == 8)
    assert np.unique(stage.chunks()[-1][1]).tolist() == [-0.25]
    stage.tick(8)
    assert [m.position[0] for m in stage.setpoints] == [0.5, -0.25]
    stick.publish(stick_message(float("nan")))
    ros.spin_until(lambda: stage.node.refusals.counts["finite"] == 1)
    stage.tick(9)
    assert stage.setpoints[-1].position[0] == -0.25
