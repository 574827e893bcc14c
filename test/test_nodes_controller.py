"""The controller node against partners that play plant and reference."""

from typing import Any

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from ros_fixtures import Partner, Ros, overrides

from skydiver_utc.nodes import topics
from skydiver_utc.nodes.lockstep_controller import ControllerNode
from skydiver_utc.nodes.messages import NamedValuesWriter, StateWriter, read_named_values
from skydiver_utc.nodes.preview import PreviewWriter
from skydiver_utc.plant.skydiver import CONTROL_NAMES
from skydiver_utc.simulation.build import build_controller, build_plant, build_reference

pytest_plugins = ("ros_fixtures",)


class Stage:
    """A controller node, and the plant and reference that a test plays to it."""

    def __init__(self, ros: Ros, **parameters: object) -> None:
        self.ros = ros
        brief = {"rejoin_wait_s": 0.3}  # nobody here tells what is applied
        self.node: ControllerNode = ros.add(ControllerNode(ros.context, overrides(**(brief | parameters))))
        self.scenario = self.node.scenario
        self.plant: Partner = ros.partner("plant")
        self.commands = self.plant.hear(topics.COMMAND)
        self.telemetry = self.plant.hear(topics.TELEMETRY)
        self.states = self.plant.sends(topics.STATE)
        self.preview_steps = build_controller(self.scenario).preview_steps
        self.state = build_plant(self.scenario).initial_state()

    def reference(self, k0: int = 0, count: int | None = None) -> Any:
        """A chunk of the scenario's reference."""
        count = self.preview_steps + 50 if count is None else count
        values = build_reference(self.scenario).preview(k0, count)
        return PreviewWriter(self.node.grid, "yaw_rate", count).fill(k0, values)

    def state_message(self, k: int) -> Any:
        return StateWriter(self.node.grid).fill(k, self.state)

    def ready(self) -> "Stage":
        """Send the reference and wait until the node listens to the state."""
        self.plant.sends(topics.REFERENCE_PREVIEW).publish(self.reference())
        self.ros.spin_until(lambda: self.states.get_subscription_count())
        return self

    def answered(self, count: int) -> list[int]:
        """The steps of the commands, once there are so many."""
        self.ros.spin_until(lambda: len(self.commands) >= count)
        return [self.node.grid.step_of(message.header.stamp) for message in self.commands]


@pytest.fixture
def stage(ros: Ros) -> Stage:
    return Stage(ros)


def test_each_state_is_answered_as_in_process(stage: Stage) -> None:
    stage.ready()
    controller = build_controller(stage.scenario)
    for k in range(4):
        stage.states.publish(stage.state_message(k))
        assert stage.answered(k + 1) == list(range(k + 1))
        preview = build_reference(stage.scenario).preview(k, stage.preview_steps + 1)
        decision = controller.decide(stage.state, preview)
        assert read_named_values(stage.commands[k], CONTROL_NAMES).tobytes() == decision.control.tobytes()
    stage.ros.spin_until(lambda: len(stage.telemetry) == 4)
    names = (*controller.telemetry_names, "solve_time", "status")
    values = read_named_values(stage.telemetry[3], names)
    assert values[:-2].tobytes() == decision.telemetry.tobytes()
    assert 0.0 < values[-2] < 10.0
    assert values[-1] == decision.status
    assert stage.node.grid.step_of(stage.telemetry[3].header.stamp) == 3


def test_it_listens_to_the_state_only_when_it_can_answer(stage: Stage) -> None:
    stage.ros.spin_for(0.2)
    assert stage.states.get_subscription_count() == 0
    stage.plant.sends(topics.REFERENCE_PREVIEW).publish(stage.reference(count=stage.preview_steps))
    stage.ros.spin_for(0.2)
    assert stage.states.get_subscription_count() == 0
    stage.ready()


def test_it_waits_for_an_awaited_recorder(ros: Ros) -> None:
    stage = Stage(ros, wait_for_recorder=True)
    stage.plant.sends(topics.REFERENCE_PREVIEW).publish(stage.reference())
    ros.spin_for(0.3)
    assert stage.states.get_subscription_count() == 0
    recorder = ros.partner("recorder")
    recorder.hear(topics.COMMAND)
    recorder.hear(topics.CHANGES)
    stage.ready()


def test_it_waits_for_the_reference_of_a_state(ros: Ros) -> None:
    stage = Stage(ros, duration_s=1.0).ready()
    stage.states.publish(stage.state_message(51))
    ros.spin_for(0.2)
    assert stage.commands == []
    stage.plant.sends(topics.REFERENCE_PREVIEW).publish(stage.reference(k0=40))
    assert stage.answered(1) == [51]


def test_a_repeated_state_is_answered_again_without_deciding_again(stage: Stage) -> None:
    stage.ready()
    for k in (0, 1, 1, 1):
        stage.states.publish(stage.state_message(k))
    assert stage.answered(4) == [0, 1, 1, 1]
    first, *again = (read_named_values(m, CONTROL_NAMES).tobytes() for m in stage.commands[1:])
    assert again == [first, first]
    stage.ros.spin_until(lambda: len(stage.telemetry) == 2)
    stage.ros.spin_for(0.1)
    assert len(stage.telemetry) == 2
    assert stage.node.refusals.counts == {"repeated": 2}


def test_an_older_state_is_ignored_and_counted(stage: Stage) -> None:
    stage.ready()
    for k in (0, 1, 2, 1, 3):
        stage.states.publish(stage.state_message(k))
    assert stage.answered(4) == [0, 1, 2, 3]
    assert stage.node.refusals.counts == {"older": 1}


def test_in_lockstep_a_state_ahead_of_the_answers_is_refused(stage: Stage) -> None:
    stage.ready()
    for k in (0, 1, 9, 2):
        stage.states.publish(stage.state_message(k))
    assert stage.answered(3) == [0, 1, 2]
    assert stage.node.refusals.counts == {"ahead": 1}


def test_after_a_silence_it_goes_back_to_the_step_where_the_plant_waits(stage: Stage) -> None:
    """A stranger's state was answered last: what the plant sends again is the truth."""
    stage.ready()
    for k in (0, 1, 2):
        stage.states.publish(stage.state_message(k))
    assert stage.answered(3) == [0, 1, 2]
    stage.node._answered_at -= 10.0
    applied = stage.plant.sends(topics.APPLIED_COMMAND)
    stage.states.publish(stage.state_message(1))
    stage.ros.spin_until(applied.get_subscription_count)
    applied.publish(
        NamedValuesWriter(stage.node.grid, CONTROL_NAMES).fill(0, np.array([0.7, 0.2, 0.1, -0.4]))
    )
    assert stage.answered(4) == [0, 1, 2, 1]


class Gap:
    """A flight in real time whose reference ends while its states go on; `applied` is what the plant holds."""

    def __init__(self, ros: Ros) -> None:
        self.stage = Stage(ros, duration_s=10.0, mode="real_time", rejoin_wait_s=1000.0).ready()
        self.ros, self.node = ros, self.stage.node
        self.asked: list[int] = []
        ask = self.node._rejoin

        def count(k: int) -> None:
            self.asked.append(k)
            ask(k)

        self.node._rejoin = count  # type: ignore[method-assign]
        self.applied = self.stage.plant.sends(topics.APPLIED_COMMAND)
        self.state(0)
        self.stage.answered(1)
        for k in range(100, 300, 20):  # beyond the preview, and more than what a silence may be
            self.state(k)
        ros.spin_until(lambda: self.node._pending is not None and self.node._pending[0] == 280)

    def state(self, k: int) -> None:
        self.stage.states.publish(self.stage.state_message(k))

    def hold(self, k: int) -> None:
        held = np.array([0.7, 0.2, 0.1, -0.4])
        self.applied.publish(NamedValuesWriter(self.node.grid, CONTROL_NAMES).fill(k, held))


def test_a_gap_of_the_reference_asks_once_what_is_applied_and_only_when_it_can_answer(ros: Ros) -> None:
    gap = Gap(ros)
    assert (gap.asked, gap.stage.answered(1)) == ([], [0])
    gap.stage.plant.sends(topics.REFERENCE_PREVIEW).publish(gap.stage.reference(k0=240, count=600))
    ros.spin_until(gap.applied.get_subscription_count)
    gap.state(300)
    gap.state(301)
    ros.spin_for(0.1)
    assert gap.asked == [280]
    gap.hold(300)
    assert gap.stage.answered(2) == [0, 301]
    gap.state(302)
    assert gap.stage.answered(3) == [0, 301, 302]
    assert gap.asked == [280]
    ros.spin_until(lambda: gap.applied.get_subscription_count() == 0)


def test_while_the_reference_is_away_the_warning_names_it_and_not_the_plant(ros: Ros) -> None:
    gap = Gap(ros)
    gap.node._answered_at -= 60.0
    assert gap.node._waits_for().startswith("waiting for the reference of step 280")
    gap.node._pending = None
    assert gap.node._waits_for() == ""
    gap.node._new_state_at -= 60.0
    assert gap.node._waits_for().startswith("no new state after step 0 for 60")


def test_what_was_applied_before_the_reference_went_away_again_is_asked_anew(ros: Ros) -> None:
    gap = Gap(ros)
    gap.stage.plant.sends(topics.REFERENCE_PREVIEW).publish(gap.stage.reference(k0=240, count=300))
    ros.spin_until(gap.applied.get_subscription_count)
    gap.state(500)
    ros.spin_until(lambda: gap.node._pending is not None and gap.node._pending[0] == 500)
    gap.hold(499)
    ros.spin_until(lambda: gap.applied.get_subscription_count() == 0)
    gap.stage.plant.sends(topics.REFERENCE_PREVIEW).publish(gap.stage.reference(k0=480, count=600))
    ros.spin_until(gap.applied.get_subscription_count)
    gap.hold(499)
    assert gap.stage.answered(2) == [0, 500]
    assert gap.asked == [280, 500]


def test_a_new_step_0_begins_a_new_flight(stage: Stage) -> None:
    stage.ready()
    for k in (0, 1, 2, 0, 1, 2):
        stage.states.publish(stage.state_message(k))
    assert stage.answered(6) == [0, 1, 2, 0, 1, 2]
    commands = [read_named_values(m, CONTROL_NAMES).tobytes() for m in stage.commands]
    assert commands[:3] == commands[3:]
    assert len(set(commands)) > 1


def test_the_last_state_needs_no_answer(stage: Stage) -> None:
    stage.ready()
    k = stage.scenario.steps
    stage.states.publish(stage.state_message(k - 1))
    stage.states.publish(stage.state_message(k))
    assert stage.answered(1) == [k - 1]
    stage.ros.spin_for(0.1)
    assert len(stage.commands) == 1
    assert not stage.node.refusals.counts


def broken(stage: Stage, edit: str) -> Odometry:
    message = stage.state_message(1)
    match edit:
        case "frame":
            message.header.frame_id = "map"
        case "finite":
            message.pose.pose.position.z = float("nan")
        case "quaternion":
            message.pose.pose.orientation.w += 0.1
        case "stamp":
            message.header.stamp.nanosec += 1
    return message


@pytest.mark.parametrize("kind", ["frame", "finite", "quaternion", "stamp"])
def test_a_state_that_cannot_be_used_is_counted_and_the_next_one_answered(stage: Stage, kind: str) -> None:
    stage.ready()
    stage.states.publish(broken(stage, kind))
    stage.states.publish(stage.state_message(1))
    assert stage.answered(1) == [1]
    assert stage.node.refusals.counts == {kind: 1}


def test_a_reference_that_cannot_be_used_is_counted(stage: Stage) -> None:
    message = stage.reference()
    message.joint_names = ["roll_rate"]
    stage.plant.sends(topics.REFERENCE_PREVIEW).publish(message)
    stage.ros.spin_until(lambda: stage.node.refusals.counts)
    assert stage.node.refusals.counts == {"names": 1}
    stage.ready()


def test_the_pose_controller_runs_in_the_same_node(ros: Ros) -> None:
    stage = Stage(ros, scenario="fast_turn_pose_only").ready()
    stage.states.publish(stage.state_message(0))
    assert stage.answered(1) == [0]
    assert np.isfinite(read_named_values(stage.commands[0], CONTROL_NAMES)).all()
