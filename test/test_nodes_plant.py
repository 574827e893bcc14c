"""The plant node against partners that play controller and recorder."""

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from ros_fixtures import Partner, Ros, overrides
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from skydiver_utc.nodes import topics
from skydiver_utc.nodes.lockstep_plant import PlantNode
from skydiver_utc.nodes.messages import NamedValuesWriter, read_named_values, read_state
from skydiver_utc.nodes.stamps import StepGrid
from skydiver_utc.plant.skydiver import CONTROL_NAMES
from skydiver_utc.simulation.build import build_plant
from skydiver_utc.simulation.outcome import Outcome

pytest_plugins = ("ros_fixtures",)

COMMAND = np.array([0.5, 0.1, 0.2, 0.3])


def plant_of(ros: Ros, **parameters: object) -> PlantNode:
    return ros.add(PlantNode(ros.context, overrides(**parameters)))  # type: ignore[arg-type, no-any-return]


def controller_of(ros: Ros, plant: PlantNode, answer: Callable[[int], Any] | None = None) -> Partner:
    """Answers each state by `answer(k)`, with `COMMAND` when there is none."""
    partner = ros.partner("controller")
    sender = partner.sends(topics.COMMAND)
    write = NamedValuesWriter(plant.grid, CONTROL_NAMES).fill

    def on_state(message: Any) -> None:
        k = plant.grid.step_of(message.header.stamp)
        reply = write(k, COMMAND) if answer is None else answer(k)
        if reply is not None:
            sender.publish(reply)

    partner.hear(topics.STATE, on_state)
    return partner


def steps_of(messages: list[Any], plant: PlantNode) -> list[int]:
    return [plant.grid.step_of(message.header.stamp) for message in messages]


def test_it_flies_in_lockstep_and_tells_everything(ros: Ros) -> None:
    plant = plant_of(ros)
    partner = controller_of(ros, plant)
    heard = {t: partner.hear(t) for t in (topics.CLOCK, topics.APPLIED_COMMAND, topics.JOINT_STATES)}
    states = partner.heard[topics.STATE]
    ros.spin_until(lambda: plant.finished)
    assert (plant.outcome, plant.k) == (Outcome.COMPLETED, plant.scenario.steps)
    ros.spin_until(lambda: len(heard[topics.CLOCK]) == plant.scenario.steps + 1 == len(states))
    ros.spin_until(lambda: len(heard[topics.APPLIED_COMMAND]) == plant.scenario.steps)

    reference = build_plant(plant.scenario)
    state, applied = reference.initial_state(), reference.initial_applied()
    for k, message in enumerate(states):
        assert plant.grid.step_of(message.header.stamp) == k
        assert read_state(message).tobytes() == state.tobytes()
        assert plant.grid.step_of(heard[topics.CLOCK][k].clock) == k
        if k < plant.scenario.steps:
            before, applied = applied, reference.actuate(COMMAND, applied)
            state = reference.step(state, before, applied)
            told = heard[topics.APPLIED_COMMAND][k]
            assert plant.grid.step_of(told.header.stamp) == k
            assert read_named_values(told, CONTROL_NAMES).tobytes() == applied[:4].tobytes()
    postures = heard[topics.JOINT_STATES]
    assert steps_of(postures, plant) == [0, 8, 16]
    assert tuple(postures[0].name) == reference.joint_names


def test_scenario_and_outcome_wait_for_late_listeners(ros: Ros) -> None:
    plant = plant_of(ros)
    controller_of(ros, plant)
    ros.spin_until(lambda: plant.finished)
    late = ros.partner("late")
    outcomes, scenarios = late.hear(topics.OUTCOME), late.hear(topics.SCENARIO)
    ros.spin_until(lambda: outcomes and scenarios)
    told = json.loads(outcomes[0].data)
    assert told["outcome"] == "completed"
    assert told["reason"] == plant.reason
    assert told["states"] == plant.scenario.steps + 1
    assert 0.0 < told["wall_time_s"] < 60.0
    assert f"duration_s: {plant.scenario.duration_s}" in scenarios[0].data
    assert plant.close() == 0


def test_it_reports_progress_in_json_lines(ros: Ros, capfd: pytest.CaptureFixture[str]) -> None:
    plant = plant_of(ros, duration_s=0.6, progress=True)
    controller_of(ros, plant)
    ros.spin_until(lambda: plant.finished)
    lines = [json.loads(line) for line in capfd.readouterr().out.splitlines()]
    assert lines[:-1] == [{"step": 119, "steps": 143}]
    assert set(lines[-1]) >= {"outcome", "reason", "wall_time_s"}


def test_it_says_nothing_on_stdout_unasked(ros: Ros, capfd: pytest.CaptureFixture[str]) -> None:
    plant = plant_of(ros)
    controller_of(ros, plant)
    ros.spin_until(lambda: plant.finished)
    assert capfd.readouterr().out == ""


def begun(ros: Ros, **parameters: object) -> PlantNode:
    """A plant at step 0 whose controller never answers."""
    plant = plant_of(ros, command_timeout_s=50.0, **parameters)
    controller_of(ros, plant, lambda _: None)
    ros.spin_until(lambda: plant.k == 0)
    return plant


def command(grid: StepGrid, k: int = 0, values: Any = COMMAND) -> Any:
    return NamedValuesWriter(grid, CONTROL_NAMES).fill(k, np.asarray(values, dtype=np.float64))


def test_commands_that_cannot_be_used_are_counted_and_the_flight_waits(ros: Ros) -> None:
    plant = begun(ros)
    swapped = command(plant.grid)
    swapped.name = [CONTROL_NAMES[1], CONTROL_NAMES[0], *CONTROL_NAMES[2:]]
    off_grid = command(plant.grid)
    off_grid.header.stamp.nanosec += 1
    unstamped = JointState(name=list(CONTROL_NAMES), position=COMMAND.tolist())
    bad = [
        ("stamp", command(plant.grid, k=1)),
        ("stamp", off_grid),
        ("stamp", unstamped),
        ("names", swapped),
        ("finite", command(plant.grid, values=[0.5, np.nan, 0.0, 0.0])),
        ("finite", command(plant.grid, values=[0.5, 0.0, 0.0, -np.inf])),
        ("size", JointState(header=command(plant.grid).header, name=list(CONTROL_NAMES))),
    ]
    expected: dict[str, int] = {}
    for kind, message in bad:
        plant.on_command(message)
        expected[kind] = expected.get(kind, 0) + 1
        assert plant.refusals.counts == expected
        assert plant.k == 0
    plant.on_command(command(plant.grid))
    assert plant.k == 1


def test_a_repeated_answer_is_used_once(ros: Ros) -> None:
    plant = begun(ros)
    plant.on_command(command(plant.grid, 0))
    plant.on_command(command(plant.grid, 0, [3.0, 0.0, 0.0, 1.0]))
    assert plant.k == 1
    assert plant.refusals.counts == {"repeated": 1}


def test_a_command_before_the_flight_or_after_it_changes_nothing(ros: Ros) -> None:
    plant = plant_of(ros)
    plant.on_command(command(plant.grid, 0))
    assert plant.k == -1
    controller_of(ros, plant)
    ros.spin_until(lambda: plant.finished)
    plant.on_command(command(plant.grid, plant.k))
    assert plant.k == plant.scenario.steps


def test_a_late_command_is_asked_for_again_with_the_same_state(ros: Ros) -> None:
    plant = plant_of(ros, command_timeout_s=0.1)
    deaf = {0: 1, 3: 2}
    write = NamedValuesWriter(plant.grid, CONTROL_NAMES).fill

    def answer(k: int) -> Any:
        deaf[k] = deaf.get(k, 0) - 1
        return None if deaf[k] >= 0 else write(k, COMMAND)

    states = controller_of(ros, plant, answer).heard[topics.STATE]
    ros.spin_until(lambda: plant.finished)
    assert plant.outcome is Outcome.COMPLETED
    ros.spin_until(lambda: plant.grid.step_of(states[-1].header.stamp) == plant.scenario.steps)
    steps = steps_of(states, plant)
    assert steps == sorted(steps)
    assert steps.count(0) >= 2
    assert steps.count(3) >= 3
    first, again = (s for s in states if plant.grid.step_of(s.header.stamp) == 0)
    assert read_state(first).tobytes() == read_state(again).tobytes()


def test_it_gives_up_after_the_last_retry(ros: Ros) -> None:
    plant = plant_of(ros, command_timeout_s=0.05, command_retries=2)
    write = NamedValuesWriter(plant.grid, CONTROL_NAMES).fill
    partner = controller_of(ros, plant, lambda k: write(k, COMMAND * np.nan) if k == 5 else write(k, COMMAND))
    ros.spin_until(lambda: plant.finished)
    assert (plant.outcome, plant.k) == (Outcome.NO_COMMAND, 5)
    assert "no command for step 5" in plant.reason
    assert "Cm_damp_yaw is nan" in plant.reason
    ros.spin_until(lambda: steps_of(partner.heard[topics.STATE], plant).count(5) == 3)
    assert plant.close() == 1


def test_without_a_controller_it_gives_up_at_the_startup_timeout(ros: Ros) -> None:
    plant = plant_of(ros, startup_timeout_s=0.2)
    ros.spin_until(lambda: plant.finished)
    assert (plant.outcome, plant.k) == (Outcome.NO_COMMAND, -1)
    assert "no publisher of command" in plant.reason
    assert plant.close() == 1


def test_a_spectator_is_no_controller(ros: Ros) -> None:
    """Somebody who only watches the state must not make the flight begin."""
    plant = plant_of(ros, startup_timeout_s=1.0)
    ros.partner("spectator").hear(topics.STATE)
    ros.partner("mute").sends(topics.COMMAND)
    ros.spin_until(lambda: plant.finished)
    assert plant.k == -1
    assert "no controller that listens to state" in plant.reason


def test_it_waits_for_the_recorder_when_asked_to(ros: Ros) -> None:
    plant = plant_of(ros, wait_for_recorder=True)
    controller_of(ros, plant)
    recorder = ros.partner("recorder")
    for topic in topics.RECORDED:
        if topic.publisher == topics.PLANT or topic is topics.CHANGES:
            recorder.hear(topic)
    ros.spin_for(0.5)
    assert plant.k == -1
    recorder.sends(topics.RECORDER_READY).publish(String(data="here"))
    ros.spin_until(lambda: plant.finished)
    assert plant.outcome is Outcome.COMPLETED


def test_a_flight_that_is_stopped_is_aborted_and_says_so(ros: Ros) -> None:
    plant = begun(ros)
    outcomes = ros.partner("listener").hear(topics.OUTCOME)
    assert plant.close() == 0
    ros.spin_until(lambda: outcomes)
    told = json.loads(outcomes[0].data)
    assert told["outcome"] == "aborted"
    assert "at step 0" in told["reason"]
    assert told["states"] == 1


def test_stopped_before_the_flight_it_is_aborted_too(ros: Ros) -> None:
    plant = plant_of(ros)
    assert plant.close() == 0
    assert (plant.outcome, plant.reason) == (
        Outcome.ABORTED,
        "stopped by a signal before the flight began",
    )


def test_a_body_that_rolled_over_flies_on_to_the_end(ros: Ros) -> None:
    plant = plant_of(ros, initial__bank_deg=120.0)
    controller_of(ros, plant)
    ros.spin_until(lambda: plant.finished)
    assert (plant.outcome, plant.k) == (Outcome.ROLLED_OVER, plant.scenario.steps)
    assert plant.close() == 0


def test_a_state_that_leaves_the_model_ends_the_flight(ros: Ros, monkeypatch: pytest.MonkeyPatch) -> None:
    plant = plant_of(ros)
    step = plant._plant.step

    def diverging(state: Any, before: Any, applied: Any) -> Any:
        following = step(state, before, applied)
        return following * np.nan if plant.k == 3 else following

    monkeypatch.setattr(plant._plant, "step", diverging)
    states = controller_of(ros, plant).heard[topics.STATE]
    ros.spin_until(lambda: plant.finished)
    assert (plant.outcome, plant.k) == (Outcome.DIVERGED, 4)
    ros.spin_until(lambda: len(states) == 5)
    assert plant.close() == 1
