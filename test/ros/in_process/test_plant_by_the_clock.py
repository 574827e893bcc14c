# SPDX-License-Identifier: Apache-2.0
"""The plant node in real time."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from own_slots import cart_file
from ros_fixtures import JOINT_STATE, Ros

from skydiver_utc.loop.outcome import Outcome
from skydiver_utc.messages import read_outcome
from skydiver_utc.nodes import topics

pytest_plugins = ("ros_fixtures",)


class Stage:
    """A cart by the clock, its controller where asked for."""

    def __init__(self, ros: Ros, folder: Path, duration_s: float = 0.3, **settings: object) -> None:
        self.ros = ros
        self.given = {"scenario": cart_file(folder), "duration_s": duration_s, "mode": "real_time"}
        self.plant = ros.node("plant", self.given | settings)
        self.partner = ros.partner("own_controller")
        self.outcomes = self.partner.receive(topics.OUTCOME)

    def controller(self) -> None:
        self.ros.start(self.given, "reference", "controller")

    def own_controller(self, then: Callable[[Any, Any], None]) -> None:
        """A partner that commands: `then(state, commands)` for each state."""
        commands = self.partner.publisher(topics.COMMAND)
        self.partner.receive(JOINT_STATE, lambda message: then(message, commands))

    def outcome(self) -> dict[str, Any]:
        self.ros.spin_until(lambda: self.outcomes)
        return read_outcome(self.outcomes[0].data)


def answer(state: Any, commands: Any) -> None:
    message = topics.COMMAND.type(name=["force", "brake"], position=[2.0, 0.5])
    message.header.stamp = state.header.stamp
    commands.publish(message)


def test_a_run_by_the_clock_lasts_its_time_and_every_step_is_accounted_for(ros: Ros, tmp_path: Path) -> None:
    stage = Stage(ros, tmp_path)
    stage.controller()
    found = stage.outcome()
    account = found["real_time"]
    assert found["outcome"] == "completed"
    assert found["wall_time_s"] >= 0.29
    assert account["steps"] == 30
    assert account["on_time"] + account["late"] + account["stale"] + account["lost"] == 30
    assert stage.plant.close() == 0


def test_without_a_first_command_the_clock_does_not_begin(ros: Ros, tmp_path: Path) -> None:
    stage = Stage(ros, tmp_path, command_timeout_s=0.1, command_retries=1)
    stage.own_controller(lambda state, commands: None)
    found = stage.outcome()
    assert (found["outcome"], found["states"]) == ("no_command", 1)


def test_when_the_commands_stop_it_goes_to_neutral_and_the_outcome_is_no_command(
    ros: Ros, tmp_path: Path
) -> None:
    stage = Stage(ros, tmp_path, neutral_after_s=0.05, neutral_time_s=0.1)
    applied = stage.partner.receive(topics.APPLIED_COMMAND)

    def answer_the_first(state: Any, commands: Any) -> None:
        if stage.plant.grid.step_of(state.header.stamp) < 5:
            answer(state, commands)

    stage.own_controller(answer_the_first)
    found = stage.outcome()
    ros.spin_until(lambda: len(applied) == 30)
    assert found["outcome"] == Outcome.NO_COMMAND.value
    assert found["states"] == 31
    assert found["real_time"]["neutral_steps"] > 10
    assert list(applied[2].position) == [2.0, 0.5]
    assert list(applied[-1].position) == [0.0, 0.0]
    assert stage.plant.close() == 1


def test_it_does_not_pause(ros: Ros, tmp_path: Path) -> None:
    stage = Stage(ros, tmp_path, 5.0)
    stage.own_controller(answer)
    ros.spin_until(lambda: stage.plant.k > 3)
    stage.plant.trigger_deactivate()
    assert stage.plant.lifecycle == "active"


def test_the_controller_answers_the_newest_state_and_counts_the_others(ros: Ros, tmp_path: Path) -> None:
    stage = Stage(ros, tmp_path, 2.0)
    stage.controller()
    ros.spin_until(lambda: stage.plant.k > 10)
    # The executor of all nodes stands still, as a busy controller does: the plant catches up at once.
    before = stage.plant.k
    deadline = stage.plant.get_clock().now().nanoseconds + 200_000_000
    while stage.plant.get_clock().now().nanoseconds < deadline:
        pass
    found = stage.outcome()
    account = found["real_time"]
    assert account["longest_silence_steps"] >= 10
    assert account["late"] + account["lost"] >= 10
    assert stage.plant.k > before
    assert found["outcome"] == "completed"
