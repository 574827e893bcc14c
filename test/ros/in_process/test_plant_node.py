# SPDX-License-Identifier: Apache-2.0
"""The plant node in lockstep and by the clock: the commands it steps on, retransmission, and its ends."""

import json
import time
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

    def __init__(self, ros: Ros, folder: Path, text: str = CART, **settings: object) -> None:
        self.ros = ros
        self.given = {"scenario": cart_file(folder, text), **settings}
        self.plant = ros.node("plant", self.given)
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

    def answer(self, last: int = 10_000, **fields: Any) -> None:
        """Answer each state at once, up to this step."""

        def answered(state: Any) -> None:
            k = self.plant.grid.step_of(state.header.stamp)
            if k <= last:
                self.send(k, **fields)

        self.partner.receive(JOINT_STATE, answered)

    def outcome(self) -> dict[str, Any]:
        self.ros.spin_until(lambda: self.outcomes)
        return read_outcome(self.outcomes[0].data)


@pytest.fixture
def stage(ros: Ros, tmp_path: Path) -> Stage:
    return Stage(ros, tmp_path)


def test_commands_that_cannot_be_used_are_counted_the_run_waits_and_an_answer_counts_once(
    stage: Stage,
) -> None:
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


@pytest.mark.parametrize("mode", ["lockstep", "real_time"])
def test_it_gives_up_after_the_last_retry_for_the_first_command(ros: Ros, tmp_path: Path, mode: str) -> None:
    stage = Stage(ros, tmp_path, mode=mode, command_timeout_s=0.1, command_retries=2)
    found = stage.outcome()
    assert (found["outcome"], found["states"]) == ("no_command", 1)
    assert stage.plant.retransmitted == 2
    assert stage.plant.health().level is Level.ERROR
    assert stage.plant.close() == 1


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


@pytest.mark.parametrize("ending", [("shutdown",), ("deactivate", "cleanup")])
def test_a_command_of_a_pause_is_used_after_it_and_a_run_that_is_ended_is_aborted(
    stage: Stage, ending: tuple[str, ...]
) -> None:
    stage.begin()
    stage.plant.trigger_deactivate()
    for _ in range(2):
        stage.send(0)
    stage.ros.spin_until(lambda: stage.plant.refusals.counts["repeated"] == 1)
    assert stage.plant.k == 0
    stage.plant.trigger_activate()
    assert stage.plant.k == 1
    for transition in ending:
        getattr(stage.plant, f"trigger_{transition}")()
    assert stage.outcome()["outcome"] == "aborted"


@pytest.mark.parametrize("begun", [False, True])
def test_a_run_that_is_stopped_is_aborted_as_a_late_subscriber_is_told(stage: Stage, begun: bool) -> None:
    if begun:
        stage.begin()
    assert stage.plant.close() == 0
    found = stage.outcome()
    assert (found["outcome"], found["states"]) == ("aborted", int(begun))
    late = stage.ros.partner("late")
    scenarios, outcomes = late.receive(topics.SCENARIO), late.receive(topics.OUTCOME)
    stage.ros.spin_until(lambda: scenarios and outcomes)
    assert run_id_of(scenarios[0].data) == read_outcome(outcomes[0].data)["run_id"] == stage.plant.run_id


@pytest.mark.parametrize("progress", [True, False])
def test_progress_is_printed_as_json_lines_where_asked_for(
    ros: Ros, tmp_path: Path, capfd: pytest.CaptureFixture[str], progress: bool
) -> None:
    stage = Stage(ros, tmp_path, progress=progress)
    stage.answer()
    stage.outcome()
    lines = [json.loads(line) for line in capfd.readouterr().out.splitlines()]
    assert [line["outcome"] for line in lines if "outcome" in line] == (["completed"] if progress else [])
    assert bool(lines) is progress


def test_two_publishers_of_command_are_an_error(stage: Stage) -> None:
    stage.begin()
    stage.ros.partner("second").publisher(topics.COMMAND)
    stage.ros.spin_until(lambda: stage.plant.health().level is Level.ERROR)


def test_a_mishap_is_the_outcome_of_a_run_that_goes_on(ros: Ros, tmp_path: Path) -> None:
    stage = Stage(ros, tmp_path, CART.replace("own_slots:Cart", "own_slots:CartWithMishap"), duration_s=0.02)
    stage.answer()
    found = stage.outcome()
    assert (found["outcome"], found["states"], stage.plant.close()) == ("rolled_over", 3, 0)


def by_the_clock(ros: Ros, folder: Path, duration_s: float = 0.3, **settings: object) -> Stage:
    return Stage(ros, folder, duration_s=duration_s, mode="real_time", **settings)


def test_a_run_by_the_clock_lasts_its_time_and_every_step_is_accounted_for(ros: Ros, tmp_path: Path) -> None:
    stage = by_the_clock(ros, tmp_path)
    stage.answer()
    found = stage.outcome()
    account = found["real_time"]
    assert found["outcome"] == "completed"
    assert found["wall_time_s"] >= 0.29
    assert account["steps"] == 30
    assert account["on_time"] + account["late"] + account["stale"] + account["lost"] == 30
    assert stage.plant.close() == 0


def test_when_the_commands_stop_it_goes_to_neutral_and_the_outcome_is_no_command(
    ros: Ros, tmp_path: Path
) -> None:
    stage = by_the_clock(ros, tmp_path, neutral_after_s=0.05, neutral_time_s=0.1)
    stage.answer(4, position=(2.0, 0.5))
    found = stage.outcome()
    ros.spin_until(lambda: len(stage.applied) == 30)
    assert (found["outcome"], found["states"]) == ("no_command", 31)
    assert found["real_time"]["neutral_steps"] > 10
    assert list(stage.applied[2].position) == [2.0, 0.5]
    assert list(stage.applied[-1].position) == [0.0, 0.0]
    assert stage.plant.close() == 1


def test_a_run_by_the_clock_does_not_pause(ros: Ros, tmp_path: Path) -> None:
    stage = by_the_clock(ros, tmp_path, 5.0)
    stage.answer()
    ros.spin_until(lambda: stage.plant.k > 3)
    stage.plant.trigger_deactivate()
    assert stage.plant.lifecycle == "active"


def test_the_controller_answers_the_newest_state_and_counts_the_others(ros: Ros, tmp_path: Path) -> None:
    given = {"scenario": cart_file(tmp_path), "duration_s": 2.0, "mode": "real_time"}
    plant, *_ = ros.start(given, "plant", "reference", "controller")
    outcomes = ros.partner().receive(topics.OUTCOME)
    ros.spin_until(lambda: plant.k > 10)
    # The executor of all nodes stands still, as a busy controller does: the plant catches up at once.
    time.sleep(0.2)
    ros.spin_until(lambda: outcomes)
    found = read_outcome(outcomes[0].data)
    assert found["real_time"]["longest_silence_steps"] >= 10
    assert found["real_time"]["late"] + found["real_time"]["lost"] >= 10
    assert found["outcome"] == "completed"
