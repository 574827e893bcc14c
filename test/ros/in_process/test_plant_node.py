# SPDX-License-Identifier: Apache-2.0
"""The plant node in lockstep: which commands it steps on, retransmission, and its ends."""

import json
from pathlib import Path
from typing import Any

import pytest
from own_slots import CART, cart_file
from plain_messages import put
from ros_fixtures import JOINT_STATE, Partner, Ros

from skydiver_utc.loop.outcome import Outcome
from skydiver_utc.messages import read_outcome, run_id_of
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.diagnostics import Level

pytest_plugins = ("ros_fixtures",)


class Stage:
    """A cart that runs, and a partner that commands it."""

    def __init__(self, ros: Ros, folder: Path, **settings: object) -> None:
        self.ros = ros
        given = {"scenario": cart_file(folder), **settings}
        self.plant = ros.node("plant", given)
        self.partner: Partner = ros.partner("own_controller")
        self.commands = self.partner.publisher(topics.COMMAND)
        self.states = self.partner.receive(JOINT_STATE)
        self.applied = self.partner.receive(topics.APPLIED_COMMAND)
        self.outcomes = self.partner.receive(topics.OUTCOME)

    def begin(self) -> None:
        self.ros.spin_until(lambda: self.plant.k == 0 and self.states)

    def command(self, k: int, names: tuple[str, ...] = ("force", "brake"), position: Any = (1.0, 0.0)) -> Any:
        message = topics.COMMAND.type(name=list(names), position=list(position))
        self.plant.grid.set_stamp(message.header.stamp, k)
        return message

    def send(self, k: int, **fields: Any) -> None:
        self.commands.publish(self.command(k, **fields))


@pytest.fixture
def stage(ros: Ros, tmp_path: Path) -> Stage:
    return Stage(ros, tmp_path)


def test_commands_that_cannot_be_used_are_counted_and_the_run_waits(stage: Stage) -> None:
    stage.begin()
    for place, value in (
        ("header.stamp.nanosec", 1),
        ("header.stamp.nanosec", 500_000_000),  # of a coming step
        ("name", ["force"]),
        ("position.0", float("nan")),
    ):
        message = stage.command(0)
        put(message, place, value)
        stage.commands.publish(message)
    stage.ros.spin_until(lambda: stage.plant.refusals.counts == {"stamp": 2, "size": 1, "finite": 1})
    assert stage.plant.k == 0
    stage.send(0)
    stage.ros.spin_until(lambda: stage.plant.k == 1)


def test_an_answer_counts_once(stage: Stage) -> None:
    stage.begin()
    stage.send(0)
    stage.ros.spin_until(lambda: stage.plant.k == 1)
    stage.send(0, position=(5.0, 1.0))
    stage.ros.spin_until(lambda: stage.plant.refusals.counts["repeated"] == 1)
    assert stage.plant.k == 1


def test_a_state_without_an_answer_is_retransmitted_with_what_was_applied(ros: Ros, tmp_path: Path) -> None:
    stage = Stage(ros, tmp_path, command_timeout_s=0.2)
    stage.begin()
    stage.send(0)
    ros.spin_until(lambda: stage.plant.retransmitted >= 2)
    ros.spin_until(lambda: len(stage.states) >= 4 and len(stage.applied) >= 3)
    assert stage.states[1] == stage.states[2] == stage.states[3]
    assert stage.applied[0] == stage.applied[1] == stage.applied[2]
    assert stage.plant.health().level is Level.WARN
    k = stage.plant.k
    stage.send(k)
    ros.spin_until(lambda: stage.plant.k == k + 1)


def test_it_gives_up_after_the_last_retry(ros: Ros, tmp_path: Path) -> None:
    stage = Stage(ros, tmp_path, command_timeout_s=0.1, command_retries=2)
    ros.spin_until(lambda: stage.plant.done and stage.outcomes)
    assert stage.plant.run.outcome is Outcome.NO_COMMAND
    assert stage.plant.retransmitted == 2
    assert stage.plant.health().level is Level.ERROR
    assert stage.plant.close() == 1
    assert read_outcome(stage.outcomes[0].data)["states"] == 1


def test_without_a_controller_it_ends_at_the_startup_timeout(ros: Ros, tmp_path: Path) -> None:
    plant = ros.node("plant", {"scenario": cart_file(tmp_path), "startup_timeout_s": 0.2})
    ros.spin_until(lambda: plant.done)
    assert (plant.run.outcome, plant.k, plant.close()) == (Outcome.NO_COMMAND, -1, 1)


def test_it_begins_only_when_the_node_that_commands_is_subscribed_to_the_state(
    ros: Ros, tmp_path: Path
) -> None:
    plant = ros.node("plant", {"scenario": cart_file(tmp_path)})
    ros.partner("spectator").receive(JOINT_STATE)
    controller = ros.partner("own_controller")
    controller.publisher(topics.COMMAND)
    ros.spin_for(0.5)
    assert plant.k == -1
    controller.receive(JOINT_STATE)
    ros.spin_until(lambda: plant.k == 0)


def test_it_waits_for_the_recorder_where_asked_to(ros: Ros, tmp_path: Path) -> None:
    stage = Stage(ros, tmp_path, wait_for_recorder=True)
    recorder = ros.partner("own_recorder")
    for topic in topics.RECORDED:
        recorder.receive(JOINT_STATE if topic is topics.STATE else topic)
    ros.spin_for(0.3)
    assert stage.plant.k == -1
    recorder.publisher(topics.RECORDER_READY).publish(topics.RECORDER_READY.type(data="here"))
    stage.begin()


@pytest.mark.parametrize("begun", [False, True])
def test_a_run_that_is_stopped_is_aborted(stage: Stage, begun: bool) -> None:
    if begun:
        stage.begin()
    assert stage.plant.close() == 0
    stage.ros.spin_until(lambda: stage.outcomes)
    found = read_outcome(stage.outcomes[0].data)
    assert (found["outcome"], found["states"]) == ("aborted", int(begun))


def test_scenario_and_outcome_reach_a_late_subscriber(stage: Stage) -> None:
    stage.begin()
    stage.plant.close()
    late = stage.ros.partner("late")
    scenarios, outcomes = late.receive(topics.SCENARIO), late.receive(topics.OUTCOME)
    stage.ros.spin_until(lambda: scenarios and outcomes)
    assert run_id_of(scenarios[0].data) == read_outcome(outcomes[0].data)["run_id"] == stage.plant.run_id


@pytest.mark.parametrize("progress", [True, False])
def test_progress_is_printed_as_json_lines_where_asked_for(
    ros: Ros, tmp_path: Path, capfd: pytest.CaptureFixture[str], progress: bool
) -> None:
    stage = Stage(ros, tmp_path, progress=progress)
    stage.begin()
    for k in range(50):
        stage.send(k)
        ros.spin_until(lambda k=k: stage.plant.k == k + 1)
    lines = [json.loads(line) for line in capfd.readouterr().out.splitlines()]
    assert [line["outcome"] for line in lines if "outcome" in line] == (["completed"] if progress else [])
    assert bool(lines) is progress


def test_two_publishers_of_command_are_an_error(stage: Stage) -> None:
    stage.begin()
    stage.ros.partner("second").publisher(topics.COMMAND)
    stage.ros.spin_until(lambda: stage.plant.health().level is Level.ERROR)


def test_a_mishap_is_the_outcome_of_a_run_that_goes_on(ros: Ros, tmp_path: Path) -> None:
    text = CART.replace("own_slots:Cart", "own_slots:CartWithMishap")
    plant = ros.node("plant", {"scenario": cart_file(tmp_path, text), "duration_s": 0.02})
    partner = ros.partner("own_controller")
    commands = partner.publisher(topics.COMMAND)

    def answer(message: Any) -> None:
        command = topics.COMMAND.type(name=["force", "brake"], position=[0.0, 0.0])
        command.header.stamp = message.header.stamp
        commands.publish(command)

    partner.receive(JOINT_STATE, answer)
    ros.spin_until(lambda: plant.done)
    assert (plant.run.outcome, plant.k, plant.close()) == (Outcome.ROLLED_OVER, 2, 0)
