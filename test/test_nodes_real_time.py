"""Flights in real time: no assertion here that a busy machine can fail.

How many commands are on time depends on the machine; that every step is accounted for and that the skydiver stays
belly to earth does not.
"""

import json
import random
import re
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ros_fixtures import NodeProcess, Processes, Ros, overrides

from skydiver_utc.nodes import topics
from skydiver_utc.nodes.lockstep_controller import ControllerNode
from skydiver_utc.nodes.lockstep_plant import PlantNode
from skydiver_utc.nodes.messages import read_named_values, read_state
from skydiver_utc.nodes.preview_publisher import ReferenceNode
from skydiver_utc.nodes.stamps import StepGrid
from skydiver_utc.parameters import load_scenario
from skydiver_utc.plant.skydiver import CONTROL_NAMES
from skydiver_utc.simulation.build import build_controller, build_plant, build_reference
from skydiver_utc.simulation.closed_loop import simulate
from skydiver_utc.simulation.outcome import Outcome, dorsal_axis_height

pytest_plugins = ("ros_fixtures",)

SCENARIO = "fast_turn_unknown_dynamics"


class Watched:
    """Everything that one real-time flight sends; its nodes wait for this process to hear them."""

    def __init__(self, ros: Ros, duration_s: float) -> None:
        self.ros = ros
        self.scenario = load_scenario(SCENARIO, {"duration_s": duration_s})
        self.grid = StepGrid(self.scenario)
        self.common = overrides(duration_s, wait_for_recorder=True)
        self.real_time = self.common | {"mode": "real_time"}
        heard = ros.spectator().heard
        self.states, self.applied = heard[topics.STATE], heard[topics.APPLIED_COMMAND]
        self.outcomes, self.commands = heard[topics.OUTCOME], heard[topics.COMMAND]
        self.heard_previews = heard[topics.REFERENCE_PREVIEW]

    def until_step(self, k: int) -> int:
        """Wait for a step; returns the newest one."""
        self.ros.spin_until(lambda: self.states and self.step() >= k)
        return self.step()

    def step(self) -> int:
        return self.grid.step_of(self.states[-1].header.stamp)

    def ended(self) -> dict[str, Any]:
        """The outcome, once everything is there: each step with its state and what was applied."""
        self.ros.spin_until(lambda: self.outcomes)
        told = json.loads(self.outcomes[-1].data)
        steps = told["states"] - 1
        self.ros.spin_until(lambda: len({self.grid.step_of(m.header.stamp) for m in self.applied}) == steps)
        self.ros.spin_until(lambda: self.step() == steps)
        assert told["real_time"]["steps"] == steps == self.scenario.steps
        account = told["real_time"]
        assert sum(account[name] for name in ("on_time", "late", "stale", "lost")) == steps
        return dict(told)

    def heights(self) -> Any:
        return dorsal_axis_height(np.array([read_state(message) for message in self.states]))

    def applied_control(self, k: int) -> Any:
        message = next(m for m in self.applied if self.grid.step_of(m.header.stamp) == k)
        return read_named_values(message, CONTROL_NAMES)


def test_a_flight_stays_belly_to_earth_and_every_step_is_accounted_for(
    ros: Ros, processes: Processes
) -> None:
    flight = Watched(ros, 4.0)
    plant = processes.start("plant", flight.real_time | {"progress": True})
    processes.start("controller", flight.real_time | {"delay_steps": 1})
    processes.start("reference", flight.common)
    told = flight.ended()
    assert told["outcome"] in (
        "completed",
        "no_command",
    )  # the latter where the machine starved the controller
    assert flight.heights().min() > 0.0
    assert told["wall_time_s"] >= flight.scenario.steps * flight.scenario.dt_s - 0.01
    assert plant.wait() == (0 if told["outcome"] == "completed" else 1)
    assert plant.reports()[-1] == told


def test_a_controller_stalled_for_100_ms_and_for_5_s(ros: Ros, processes: Processes) -> None:
    """The plant bridges the first with the last command, falls neutral in the second, then turns again."""
    flight = Watched(ros, 16.0)
    processes.start("plant", flight.real_time)
    processes.start("reference", flight.common)
    controller = processes.start("controller", flight.real_time)

    def stall(begin: int, steps: int) -> int:
        flight.until_step(begin)
        controller.signal(signal.SIGSTOP)
        end = flight.until_step(flight.step() + steps)
        controller.signal(signal.SIGCONT)
        return end

    stall(200, 24)
    end = stall(500, 1191)
    controller.wait_for_output("goes on from the command applied at step")
    told = flight.ended()
    account = told["real_time"]
    assert account["longest_silence_steps"] > 1000
    assert account["neutral_steps"] > 900
    assert account["late"] + account["lost"] > 1000
    initial = build_plant(flight.scenario).initial_control()
    neutral = flight.applied_control(end - 20)
    assert neutral[[0, 1, 2]].tolist() == [initial[0], 0.0, 0.0]
    assert neutral[3] == pytest.approx(0.0, abs=1e-3)
    assert flight.heights().min() > 0.0
    assert told["outcome"] in ("completed", "no_command")
    assert "in the neutral posture" in told["reason"]


def test_when_the_controller_dies_the_skydiver_falls_on_neutral_and_the_outcome_says_so(
    ros: Ros, processes: Processes
) -> None:
    flight = Watched(ros, 4.0)
    plant = processes.start("plant", flight.real_time)
    processes.start("reference", flight.common)
    controller = processes.start("controller", flight.real_time)
    flight.until_step(100)
    controller.kill()
    told = flight.ended()
    assert told["outcome"] == "no_command"
    assert "the skydiver fell on in the neutral posture" in told["reason"]
    assert flight.heights().min() > 0.0
    assert plant.wait() == 1


class Killed(Watched):
    """A flight of processes, longer than any test of it takes: it is stopped."""

    def __init__(self, ros: Ros, processes: Processes) -> None:
        super().__init__(ros, 600.0)
        self.processes = processes
        self.nodes = {kind: self.start(kind) for kind in ("plant", "reference", "controller")}

    def start(self, kind: str) -> NodeProcess:
        return self.processes.start(kind, self.common if kind == "reference" else self.real_time)

    def kill_and_start(self, kind: str) -> int:
        """The step at which it was killed, or soon after."""
        self.until_step(100)
        self.nodes[kind].kill()
        killed_at = self.step()
        self.nodes[kind] = self.start(kind)
        return killed_at

    def stop(self) -> dict[str, Any]:
        """The outcome; each step is there and in the account, which has the step under way, too."""
        self.nodes["plant"].signal(signal.SIGINT)
        self.ros.spin_until(lambda: self.outcomes)
        told = dict(json.loads(self.outcomes[-1].data))
        account, steps = told["real_time"], told["states"] - 1
        self.ros.spin_until(lambda: self.steps_of(self.applied) == set(range(steps)))
        self.ros.spin_until(lambda: self.steps_of(self.states) == set(range(steps + 1)))
        assert account["steps"] == steps + 1
        assert sum(account[name] for name in ("on_time", "late", "stale", "lost")) == steps + 1
        assert told["outcome"] == "aborted"
        assert self.heights().min() > 0.0
        assert self.nodes["plant"].wait() == 0
        return told

    def told(self) -> int:
        """The step up to which the reference has told what is wanted."""
        return max(self.grid.step_of(c.header.stamp) + len(c.points) for c in self.heard_previews)

    def steps_of(self, messages: list[Any]) -> set[int]:
        return {self.grid.step_of(message.header.stamp) for message in messages}


def test_a_controller_killed_and_started_again_goes_on_from_the_applied_command(
    ros: Ros, processes: Processes
) -> None:
    """Its first answer is, bit for bit, that of a controller which resumes from what the plant held."""
    flight = Killed(ros, processes)
    killed_at = flight.kill_and_start("controller")
    controller = flight.nodes["controller"]
    controller.wait_for_output("goes on from the command applied at step")
    heard = len(flight.commands)
    ros.spin_until(lambda: len(flight.commands) > heard + 100)
    flight.stop()
    match = re.search(r"goes on from the command applied at step (\d+)", controller.output)
    assert match is not None
    held_at = int(match[1])
    assert held_at >= killed_at - 1
    answers = [m for m in flight.commands if flight.grid.step_of(m.header.stamp) > held_at]
    first = flight.grid.step_of(answers[0].header.stamp)
    pilot = build_controller(flight.scenario)
    pilot.resume(flight.applied_control(held_at))
    state = next(read_state(m) for m in flight.states if flight.grid.step_of(m.header.stamp) == first)
    reference = build_reference(flight.scenario).preview(first, pilot.preview_steps + 1)
    expected = pilot.decide(state, reference).control
    assert read_named_values(answers[0], CONTROL_NAMES).tobytes() == expected.tobytes()


def test_a_reference_killed_and_started_again_is_heard_in_real_time(ros: Ros, processes: Processes) -> None:
    """It comes in at a step that the clock has reached since its start, with the chunk of that step.

    How long the first new command takes from there is measured by what the node takes from its start to that step,
    in the same run: its process has to start and find the others.
    """
    flight = Killed(ros, processes)
    started_at = flight.kill_and_start("reference")
    reference = flight.nodes["reference"]
    told = flight.told()
    ros.spin_until(lambda: "ready" in reference.output)
    ready_at = flight.step()
    ros.spin_until(lambda: max(flight.steps_of(flight.commands)) > told + 100)
    ros.spin_until(lambda: flight.told() > told + 100)
    flight.stop()
    match = re.search(r"ready: comes in at step (\d+) of the clock", reference.output)
    assert match is not None, reference.output
    came_in_at = int(match[1])
    assert came_in_at >= started_at
    chunks = [flight.grid.step_of(chunk.header.stamp) for chunk in flight.heard_previews]
    assert chunks == sorted(chunks)  # none of a step that was over
    assert came_in_at - came_in_at % 80 in chunks
    first = min(k for k in flight.steps_of(flight.commands) if k > max(told - 241, came_in_at))
    print(f"started at {started_at}, came in at {came_in_at}, ready by {ready_at}, first command {first}")
    assert first - ready_at <= ready_at - started_at


def test_a_recorder_killed_in_real_time_does_not_stop_the_flight(
    ros: Ros, processes: Processes, tmp_path: Path
) -> None:
    flight = Killed(ros, processes)
    # The plant waits for one that hears it: the recorder must not be that one, or the test misses the first steps.
    begun_at = flight.until_step(10)
    recorder = processes.start("recorder", overrides(600.0, bag_folder=tmp_path / "bag"))
    recorder.wait_for_output("ready")
    killed_at = flight.until_step(begun_at + 100)
    recorder.kill()
    flight.until_step(killed_at + 300)
    flight.stop()


class Lossy:
    """A publisher that loses one message in ten."""

    def __init__(self, publisher: Any, seed: int) -> None:
        self._publisher = publisher
        self._random = random.Random(seed)
        self.lost = 0

    def publish(self, message: Any) -> None:
        if self._random.random() < 0.1:
            self.lost += 1
        else:
            self._publisher.publish(message)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._publisher, name)


def lossy_flight(ros: Ros, **parameters: object) -> tuple[PlantNode, list[Lossy]]:
    given = overrides(1.0, **parameters)
    plant = ros.add(PlantNode(ros.context, given | {"command_timeout_s": 0.05, "command_retries": 1000}))
    mode = {"mode": parameters["mode"]} if "mode" in parameters else {}
    controller = ros.add(ControllerNode(ros.context, overrides(1.0, **mode)))
    ros.add(ReferenceNode(ros.context, overrides(1.0)))
    plant._states = Lossy(plant._states, 1)
    controller._commands = Lossy(controller._commands, 2)
    ros.spin_until(lambda: plant.finished)
    return plant, [plant._states, controller._commands]


def test_in_lockstep_a_tenth_of_the_messages_lost_changes_no_bit(ros: Ros) -> None:
    plant, lossy = lossy_flight(ros)
    assert plant.outcome is Outcome.COMPLETED
    assert min(link.lost for link in lossy) > 5
    assert plant.sent_again > 10
    flight = simulate(load_scenario(SCENARIO, {"duration_s": 1.0}))
    assert plant._state.tobytes() == flight.states[-1].tobytes()


def test_in_real_time_a_tenth_of_the_messages_lost_is_counted(ros: Ros) -> None:
    plant, lossy = lossy_flight(ros, mode="real_time")
    assert plant.outcome in (Outcome.COMPLETED, Outcome.NO_COMMAND)
    assert plant._real_time is not None
    account = plant._real_time.accounts.told()
    assert (
        account["lost"] >= lossy[1].lost - 2
    )  # the answers to the first and to the last state act on no step
    assert account["on_time"] + account["late"] + account["stale"] + account["lost"] == plant.scenario.steps
    assert dorsal_axis_height(plant._state) > 0.0


def test_without_a_first_command_the_clock_does_not_begin(ros: Ros) -> None:
    plant = ros.add(
        PlantNode(ros.context, overrides(mode="real_time", command_timeout_s=0.05, command_retries=3))
    )
    partner = ros.partner("controller")
    partner.sends(topics.COMMAND)
    states = partner.hear(topics.STATE)
    ros.spin_until(lambda: plant.finished)
    assert (plant.outcome, plant.k) == (Outcome.NO_COMMAND, 0)
    assert "no command for step 0" in plant.reason
    ros.spin_until(lambda: len(states) == 4)


def test_the_controller_answers_the_newest_of_the_states_that_wait(ros: Ros) -> None:
    from test_nodes_controller import Stage

    stage = Stage(ros, mode="real_time").ready()
    for k in range(8):
        stage.states.publish(stage.state_message(k))
    ros.spin_until(lambda: stage.commands and stage.node.answered == 7)
    assert len(stage.answered(1)) < 8
    assert stage.node.passed_over > 0


def test_a_recorded_flight_is_analysed_though_commands_are_missing(ros: Ros, tmp_path: Path) -> None:
    from skydiver_utc.analysis.recorded_flight import read_flight
    from skydiver_utc.nodes.bag_recorder import RecorderNode

    given = overrides(0.5, wait_for_recorder=True)
    recorder = ros.add(RecorderNode(ros.context, overrides(0.5, bag_folder=str(tmp_path / "bag"))))
    plant = ros.add(PlantNode(ros.context, given | {"mode": "real_time"}))
    ros.add(ReferenceNode(ros.context, given))
    controller = ros.add(ControllerNode(ros.context, given | {"mode": "real_time"}))
    controller._commands = Lossy(controller._commands, 3)
    ros.spin_until(lambda: plant.finished and recorder.finished)
    ros.spin_for(0.3)
    recorder.close()
    flight = read_flight(tmp_path / "bag")
    assert flight.commands.shape == (plant.scenario.steps, 4)
    assert np.isfinite(flight.commands).all()
    assert flight.states[-1].tobytes() == plant._state.tobytes()
    assert flight.outcome is plant.outcome
