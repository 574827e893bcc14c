# SPDX-License-Identifier: Apache-2.0
"""The controller node: what it answers, where it begins, and its live parameters."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from own_slots import CART, Cart, Proportional, cart_file
from plain_messages import put
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from ros_fixtures import JOINT_STATE, Partner, Ros
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from skydiver_utc.loop.build import build_reference
from skydiver_utc.messages import fill_named, fill_preview, read_named
from skydiver_utc.nodes import topics
from skydiver_utc.parameters import ParameterError

pytest_plugins = ("ros_fixtures",)

POSITIONS = np.array([[0.1, 0.0], [0.2, 0.5], [-0.1, 1.0], [0.3, -1.0], [0.0, 0.0], [0.5, 0.5]])


class Stage:
    """A controller of the cart, and partners that play plant and reference."""

    def __init__(self, ros: Ros, folder: Path, **settings: object) -> None:
        self.ros = ros
        self.node = ros.node("controller", {"scenario": cart_file(folder), **settings})
        self.partner: Partner = ros.partner("own_plant")
        self.states = self.partner.publisher(JOINT_STATE)
        self.previews = self.partner.publisher(topics.REFERENCE_PREVIEW)
        command = topics.COMMAND_TYPES[str(settings.get("command_message", "joint_state"))]
        self.commands = self.partner.receive(topics.COMMAND.of_type(command))
        self.telemetry = self.partner.receive(topics.TELEMETRY)
        self.changes = self.partner.receive(topics.CHANGES)
        self.preview = build_reference(self.node.scenario).preview

    def send_preview(self, k0: int = 0, count: int = 200) -> None:
        points = [JointTrajectoryPoint() for _ in range(count)]
        message = JointTrajectory(joint_names=["position"], points=points)
        self.previews.publish(fill_preview(message, self.node.grid, k0, self.preview(k0, count)))

    def ready(self) -> "Stage":
        """Send the reference and wait until the node is subscribed to the state."""
        self.send_preview()
        self.ros.spin_until(self.states.get_subscription_count)
        return self

    def state(self, k: int, values: Any = None) -> Any:
        message = JOINT_STATE.type(name=["position", "speed"])
        self.node.grid.set_stamp(message.header.stamp, k)
        return fill_named(message, POSITIONS[k % 6] if values is None else np.array(values))

    def send(self, *steps: int) -> None:
        for k in steps:
            self.states.publish(self.state(k))

    def send_applied(self, k: int, force: float) -> None:
        message = topics.APPLIED_COMMAND.type(name=["brake", "force"], position=[0.1, force])
        self.node.grid.set_stamp(message.header.stamp, k)
        self.partner.publisher(topics.APPLIED_COMMAND).publish(message)

    def answers(self, count: int) -> list[int]:
        """The steps of the commands, once there are so many."""
        self.ros.spin_until(lambda: len(self.commands) >= count)
        return [self.node.grid.step_of(message.header.stamp) for message in self.commands]

    def control(self) -> Any:
        return read_named(self.commands[-1], Cart.control_names)

    def decided(self, *steps: int, start: Any = None, gain: float = 3.0) -> Any:
        """What the law itself answers at these steps in a row, the last one."""
        law = Proportional(
            Proportional.Settings(kind="x", gain=gain), Cart(None, 0.01), ("position",), 0.01, 0
        )  # type: ignore[arg-type]
        if start is not None:
            law.resume(start)
        for k in steps:
            decision = law.decide(POSITIONS[k % 6], self.preview(k, 4))
        return decision.control


@pytest.fixture
def stage(ros: Ros, tmp_path: Path) -> Stage:
    return Stage(ros, tmp_path)


def test_each_state_is_answered_with_its_stamp_and_telemetry(stage: Stage) -> None:
    stage.ready()
    for k in range(4):
        stage.send(k)
        assert stage.answers(k + 1) == list(range(k + 1))
        assert stage.control().tobytes() == stage.decided(*range(k + 1)).tobytes()
    stage.ros.spin_until(lambda: len(stage.telemetry) == 4)
    error, solve_time_s, status = read_named(stage.telemetry[3], ("error", "solve_time", "status"))
    assert error == stage.preview(3, 1)[0, 0] - POSITIONS[3, 0]
    assert 0.0 < solve_time_s < 10.0
    assert status == 0
    assert not stage.changes


def test_it_subscribes_to_the_state_when_it_can_answer_and_a_state_waits_for_its_reference(
    stage: Stage,
) -> None:
    stage.send_preview(0, 3)  # one decision takes 4
    stage.ros.spin_for(0.2)
    assert stage.states.get_subscription_count() == 0
    stage.send_preview(0, 10)
    stage.ros.spin_until(stage.states.get_subscription_count)
    stage.send(30)
    stage.ros.spin_until(lambda: "reference of step 30" in stage.node.health().sentence)
    stage.send_preview(20)
    assert stage.answers(1) == [30]


def test_a_repeated_state_gets_its_answer_again_an_older_one_none_and_step_0_begins_a_new_run(
    stage: Stage,
) -> None:
    stage.ready().send(0, 1, 2, 2)
    assert stage.answers(4) == [0, 1, 2, 2]
    assert stage.commands[3] == stage.commands[2]
    assert stage.node.refusals.counts["repeated"] == 1
    stage.send(1)
    stage.ros.spin_until(lambda: stage.node.refusals.counts["older"] == 1)
    stage.send(0)
    assert stage.answers(5)[-1] == 0
    assert stage.commands[4] == stage.commands[0]


def test_messages_that_cannot_be_used_are_counted_and_the_next_state_answered(stage: Stage) -> None:
    stage.ready()
    bad = {
        "names": ("name.0", "height"),
        "finite": ("position.1", float("nan")),
        "stamp": ("header.stamp.nanosec", 1),
        "model": ("position.0", 1e3),
    }
    for place, value in bad.values():
        message = stage.state(0)
        put(message, place, value)
        stage.states.publish(message)
    scenarios = stage.partner.publisher(topics.SCENARIO)
    stage.ros.spin_until(scenarios.get_subscription_count)
    unusable = "", "plant: {", CART.replace("cart", "other").replace("own_slots:Cart", "nowhere:Cart")
    for count, text in enumerate(unusable, 1):  # of waiting ones the newest counts
        scenarios.publish(topics.SCENARIO.type(data=text))
        stage.ros.spin_until(lambda count=count: stage.node.refusals.counts["scenario"] == count)
    counts = dict.fromkeys(bad, 1) | {"scenario": 3}
    stage.ros.spin_until(lambda: stage.node.refusals.counts == counts)
    stage.send(0)
    assert stage.answers(1) == [0]


def test_a_controller_that_comes_into_a_run_begins_from_the_newest_applied_command(stage: Stage) -> None:
    applied = stage.partner.publisher(topics.APPLIED_COMMAND)
    stage.ready()
    stage.ros.spin_until(applied.get_subscription_count)
    stage.send(20)
    stage.ros.spin_until(lambda: "applied command" in stage.node.health().sentence)
    stage.send_applied(19, 2.5)
    assert stage.answers(1) == [20]
    wanted = stage.decided(20, start=(2.5, 0.1))
    assert stage.control().tobytes() == wanted.tobytes() != stage.decided(20).tobytes()
    stage.ros.spin_until(lambda: stage.changes)
    assert json.loads(stage.changes[0].data) == {
        "node": "controller", "step": 20, "parameters": {}, "control": [2.5, 0.1],
    }  # fmt: skip


def test_without_applied_commands_it_begins_from_the_initial_control_and_the_last_state_needs_no_answer(
    stage: Stage,
) -> None:
    stage.ready().send(49, 50)
    stage.answers(1)
    stage.ros.spin_for(0.2)
    assert stage.answers(1) == [49]
    assert stage.control().tobytes() == stage.decided(49).tobytes()


def test_what_was_given_to_it_and_not_to_the_plant_is_recorded(ros: Ros, tmp_path: Path) -> None:
    stage = Stage(ros, tmp_path, **{"controller.gain": 4.0, "delay_steps": 2})
    text = (tmp_path / "cart.yaml").read_text()
    stage.partner.publisher(topics.SCENARIO).publish(topics.SCENARIO.type(data=text))
    stage.ready().send(0)
    ros.spin_until(lambda: stage.changes)
    ros.spin_until(lambda: "controller.gain" in json.loads(stage.changes[-1].data)["parameters"])
    found = json.loads(stage.changes[-1].data)
    assert found["parameters"] == {"controller.gain": 4.0, "delay_steps": 2}
    assert (found["step"], found["control"]) == (0, None)


def set_parameter(stage: Stage, name: str, value: object) -> Any:
    """As `ros2 param set` does."""
    parameters = [Parameter(name, value=value).to_parameter_msg()]
    called = stage.partner.call(stage.ros, "controller/set_parameters", SetParameters, parameters=parameters)
    return called.results[0]


def test_a_setting_changes_from_the_beginning_or_at_the_next_decision_and_is_recorded(stage: Stage) -> None:
    assert set_parameter(stage, "controller.gain", 4.0).successful
    stage.ready().send(0, 1)
    stage.answers(2)
    before = stage.control()
    assert before.tobytes() == stage.decided(0, 1, gain=4.0).tobytes()
    assert set_parameter(stage, "controller.gain", 6.0).successful
    stage.send(2)
    stage.answers(3)
    assert stage.control().tobytes() == stage.decided(2, start=before, gain=6.0).tobytes()
    stage.ros.spin_until(lambda: len(stage.changes) == 2)
    first, second = (json.loads(message.data) for message in stage.changes)
    assert (first["step"], first["control"]) == (0, None)
    assert second == {
        "node": "controller", "step": 2, "parameters": {"controller.gain": 6.0}, "control": before.tolist(),
    }  # fmt: skip
    assert stage.node.get_parameter("controller.gain").value == 6.0


def test_what_cannot_be_set_is_refused_by_name_and_changes_nothing(stage: Stage) -> None:
    for name, value, word in (
        ("controller.gain", -1.0, "gain"),
        ("controller.gain", float("nan"), "gain"),
        ("controller.gain", "much", "type"),
        ("controller.gian", 1.0, "controller.gian"),
        ("duration_s", 1.0, "duration_s"),
        ("mode", "real_time", "mode"),
        ("reference.amplitude", 1.0, "amplitude"),
    ):
        result = set_parameter(stage, name, value)
        assert not result.successful
        assert word in result.reason
    stage.ready().send(0)
    stage.answers(1)
    assert stage.control().tobytes() == stage.decided(0).tobytes()


def test_a_twist_needs_a_component_for_each_control(ros: Ros, tmp_path: Path) -> None:
    given = {"scenario": cart_file(tmp_path), "command_message": "twist"}
    for components in ([], ["linear.x"], ["linear.x", "linear.w"]):
        with pytest.raises(ParameterError, match="command_components"):
            ros.node("controller", given | {"command_components": components})
