"""Each node killed (-9) in mid-flight and started again, as processes of their own."""

import json
import re
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ros_fixtures import NodeProcess, Processes, Ros, overrides
from test_nodes_flight import Bag

from skydiver_utc.nodes import topics
from skydiver_utc.nodes.lockstep_controller import ControllerNode
from skydiver_utc.nodes.lockstep_plant import PlantNode
from skydiver_utc.nodes.messages import NamedValuesWriter, StateWriter, read_named_values, read_state
from skydiver_utc.nodes.preview import PreviewWriter
from skydiver_utc.nodes.stamps import StepGrid
from skydiver_utc.parameters import load_scenario, scenario_names
from skydiver_utc.plant.skydiver import CONTROL_NAMES
from skydiver_utc.simulation.build import build_controller, build_plant, build_reference
from skydiver_utc.simulation.closed_loop import simulate

pytest_plugins = ("ros_fixtures",)

DURATION_S = 6.0  # the kill comes later than the step that it was meant for, by what the watcher lags behind
KILLED_AT = 100


class Flight:
    """Plant, reference and controller as processes, which do not fly before this process hears them."""

    def __init__(self, ros: Ros, processes: Processes, duration_s: float = DURATION_S) -> None:
        self.ros, self.processes = ros, processes
        self.given = overrides(duration_s, wait_for_recorder=True)
        self.scenario = load_scenario("fast_turn_unknown_dynamics", {"duration_s": duration_s})
        self.grid = StepGrid(self.scenario)
        heard = ros.spectator().heard
        self.states, self.commands = heard[topics.STATE], heard[topics.COMMAND]
        self.applied, self.outcomes = heard[topics.APPLIED_COMMAND], heard[topics.OUTCOME]
        patient = {"command_timeout_s": 0.5, "command_retries": 200}
        self.nodes = {"plant": processes.start("plant", self.given | patient)}
        for kind in ("controller", "reference"):
            self.start(kind)

    def start(self, kind: str) -> NodeProcess:
        self.nodes[kind] = self.processes.start(kind, self.given)
        return self.nodes[kind]

    def step(self) -> int:
        return self.grid.step_of(self.states[-1].header.stamp) if self.states else -1

    def kill(self, kind: str, at: int = KILLED_AT) -> None:
        self.ros.spin_until(lambda: self.step() >= at)
        self.nodes[kind].kill()

    def outcome(self) -> dict[str, Any]:
        self.ros.spin_until(lambda: self.outcomes)
        return dict(json.loads(self.outcomes[-1].data))


def controls(messages: list[Any], grid: StepGrid) -> dict[int, Any]:
    """The first control of each step."""
    by_step: dict[int, Any] = {}
    for message in messages:
        by_step.setdefault(grid.step_of(message.header.stamp), read_named_values(message, CONTROL_NAMES))
    return by_step


def test_a_controller_killed_and_started_again_goes_on_from_the_applied_command(
    ros: Ros, processes: Processes
) -> None:
    flight = Flight(ros, processes)
    flight.kill("controller")
    controller = flight.start("controller")
    assert flight.outcome()["outcome"] == "completed"
    ros.spin_until(lambda: flight.step() == flight.scenario.steps)
    match = re.search(r"goes on from the command applied at step (\d+)", controller.output)
    assert match is not None, controller.output
    last = int(match[1])
    assert last >= KILLED_AT - 1
    ros.spin_until(lambda: len(controls(flight.applied, flight.grid)) == flight.scenario.steps)
    # A killed process may have told the plant what this one did not hear any more: only what was heard is compared.
    commands, simulated = controls(flight.commands, flight.grid), simulate(flight.scenario)
    before = [k for k in commands if k <= last]
    assert len(before) >= KILLED_AT - 1
    assert all(commands[k].tobytes() == simulated.commands[k].tobytes() for k in before)
    assert any(commands[k].tobytes() != simulated.commands[k].tobytes() for k in commands if k > last)


def test_a_reference_killed_and_started_again_is_heard(ros: Ros, processes: Processes) -> None:
    flight = Flight(ros, processes)
    flight.kill("reference", at=10)
    flight.start("reference")
    assert flight.outcome()["outcome"] == "completed"
    ros.spin_until(lambda: len(controls(flight.commands, flight.grid)) == flight.scenario.steps)
    simulated = simulate(flight.scenario).commands
    commands = controls(flight.commands, flight.grid)
    assert np.array([commands[k] for k in range(len(simulated))]).tobytes() == simulated.tobytes()


@pytest.mark.parametrize("stalled_s", [0.1, 5.0])
def test_a_controller_that_stands_still_in_lockstep_changes_no_bit(
    ros: Ros, processes: Processes, stalled_s: float
) -> None:
    flight = Flight(ros, processes)
    ros.spin_until(lambda: flight.step() >= KILLED_AT)
    flight.nodes["controller"].signal(signal.SIGSTOP)
    ros.spin_for(stalled_s)
    stood_at = flight.step()
    flight.nodes["controller"].signal(signal.SIGCONT)
    assert KILLED_AT <= stood_at < flight.scenario.steps
    assert flight.outcome()["outcome"] == "completed"
    simulated = simulate(flight.scenario)
    ros.spin_until(lambda: len(controls(flight.commands, flight.grid)) == flight.scenario.steps)
    commands = controls(flight.commands, flight.grid)
    assert np.array([commands[k] for k in range(len(commands))]).tobytes() == simulated.commands.tobytes()
    ros.spin_until(lambda: flight.step() == flight.scenario.steps)
    states = {flight.grid.step_of(message.header.stamp): message for message in flight.states}
    flown = np.array([read_state(states[k]) for k in range(flight.scenario.steps + 1)])
    assert flown.tobytes() == simulated.states.tobytes()
    if stalled_s > 1.0:
        assert f"no command for step {stood_at}" in flight.nodes["plant"].output


def test_when_the_plant_is_killed_the_others_say_so_and_serve_the_next_one(
    ros: Ros, processes: Processes
) -> None:
    flight = Flight(ros, processes, duration_s=4.0)
    flight.kill("plant")
    for kind in ("controller", "reference"):
        flight.nodes[kind].wait_for_output("the plant's process has died or stands still")
    flight.nodes["controller"].wait_for_output("no new state after step")
    flight.nodes["reference"].wait_for_output("the clock stands still after step")
    assert flight.outcomes == []
    flight.start("plant")
    assert flight.outcome()["outcome"] == "completed"
    assert flight.nodes["plant"].wait() == 0
    for kind in ("controller", "reference"):
        flight.nodes[kind].signal(signal.SIGTERM)
        assert flight.nodes[kind].wait() == 0, flight.nodes[kind].output


def test_a_recorder_that_is_killed_does_not_stop_the_flight(processes: Processes, tmp_path: Path) -> None:
    """The flight is longer than what a publisher keeps for a listener that does not acknowledge."""
    given = overrides(30.0, wait_for_recorder=True)
    recorder = processes.start("recorder", overrides(30.0, bag_folder=tmp_path / "bag"))
    plant = processes.start("plant", given | {"progress": True})
    for kind in ("controller", "reference"):
        processes.start(kind, given)
    plant.wait_for_output('"step"')
    recorder.kill()
    at_least = plant.reports()[-1]
    assert plant.wait() == 0
    told = plant.reports()[-1]
    assert (told["outcome"], told["states"]) == ("completed", at_least["steps"] + 1)
    assert at_least["steps"] - at_least["step"] > topics.EACH_STEP.depth


def test_a_recorder_started_in_mid_flight_records_the_rest_without_a_gap(
    processes: Processes, tmp_path: Path
) -> None:
    given = overrides(600.0, wait_for_recorder=True)
    first = processes.start("recorder", overrides(600.0, bag_folder=tmp_path / "first"))
    plant = processes.start("plant", given | {"progress": True})
    for kind in ("controller", "reference"):
        processes.start(kind, given)
    plant.wait_for_output('"step"')
    first.kill()
    second = processes.start("recorder", overrides(600.0, bag_folder=tmp_path / "second"))
    second.wait_for_output("[skydiver.recorder]: ready")
    # Publishers may hear of a new listener only at its next announcement, seconds later.
    heard_by_all = plant.reports()[-1]["step"] + 100 * 119
    plant.wait_for_output(f'"step": {heard_by_all}')
    plant.signal(signal.SIGINT)
    assert (plant.wait(), second.wait()) == (0, 0)
    bag, states = Bag(tmp_path / "second"), plant.reports()[-1]["states"]
    for topic in topics.RECORDED:
        if topic.fewer_than_states is not None:
            steps = bag.steps(topic)
            # The controller may have answered the last state, too, before it heard of the end.
            assert steps[-1] - (states - 1 - topic.fewer_than_states) in (0, 1), topic.name
            assert steps == list(range(steps[0], steps[-1] + 1)), topic.name
            assert 0 < steps[0] <= heard_by_all, topic.name
    assert len(bag.of(topics.SCENARIO)) == 1
    assert bag.outcome()["outcome"] == "aborted"


class Rejoining:
    """A controller in this process that hears of a flight only at step 60."""

    def __init__(self, ros: Ros, **parameters: object) -> None:
        self.node: ControllerNode = ros.add(ControllerNode(ros.context, overrides(1.0, **parameters)))
        self.ros = ros
        self.scenario = self.node.scenario
        self.plant = ros.partner("plant")
        self.commands = self.plant.hear(topics.COMMAND)
        preview = build_reference(self.scenario).preview(0, 600)
        self.plant.sends(topics.REFERENCE_PREVIEW).publish(
            PreviewWriter(self.node.grid, "yaw_rate", 600).fill(0, preview)
        )
        self.states = self.plant.sends(topics.STATE)
        self.applied = self.plant.sends(topics.APPLIED_COMMAND)
        self.state = build_plant(self.scenario).initial_state()
        ros.spin_until(self.states.get_subscription_count)

    def send(self, k: int) -> None:
        self.states.publish(StateWriter(self.node.grid).fill(k, self.state))

    def apply(self, k: int, control: Any) -> None:
        self.applied.publish(NamedValuesWriter(self.node.grid, CONTROL_NAMES).fill(k, control))

    def answer(self) -> Any:
        self.ros.spin_until(lambda: self.commands)
        return read_named_values(self.commands[-1], CONTROL_NAMES)

    def expected(self, k: int, begin: Any = None) -> Any:
        controller = build_controller(self.scenario)
        if begin is not None:
            controller.resume(begin)
        preview = build_reference(self.scenario).preview(k, controller.preview_steps + 1)
        return controller.decide(self.state, preview).control


def controller_of(name: str) -> str:
    return str(load_scenario(name).controller.__struct_config__.tag)


HELD = np.array([0.7, 0.2, 0.1, -0.4])


@pytest.mark.parametrize("scenario", ["fast_turn_unknown_dynamics", "fast_turn_pose_only"])
def test_the_first_answer_follows_from_what_is_applied(ros: Ros, scenario: str) -> None:
    stage = Rejoining(ros, scenario=scenario, rejoin_wait_s=1000.0)
    stage.send(60)
    ros.spin_until(stage.applied.get_subscription_count)
    assert stage.commands == []
    stage.apply(59, HELD)
    assert stage.answer().tobytes() == stage.expected(60, HELD).tobytes()
    assert stage.answer().tobytes() != stage.expected(60).tobytes()
    ros.spin_until(lambda: stage.applied.get_subscription_count() == 0)  # costs nothing from then on


@pytest.mark.parametrize("kind", ["utc", "pose", "lqr", "gauss_newton", "mppi"])
def test_every_controller_goes_on_from_the_applied_command(kind: str) -> None:
    """The first alpha is within one slew of what is held, wherever the flight before had led the controller."""
    scenario = load_scenario(next(name for name in scenario_names() if controller_of(name) == kind))
    controller = build_controller(scenario)
    state = build_plant(scenario).initial_state()
    preview = build_reference(scenario).preview(0, controller.preview_steps + 1)
    for _ in range(3):
        controller.decide(state, preview)
    controller.resume(HELD)
    decided = controller.decide(state, preview).control
    assert abs(decided[3] - HELD[3]) <= scenario.plant.limits.alpha_rate * scenario.dt_s + 1e-12
    controller.reset()
    again = controller.decide(state, preview).control
    assert again.tobytes() == build_controller(scenario).decide(state, preview).control.tobytes()


def test_without_a_word_on_what_is_applied_it_begins_from_the_initial_control(ros: Ros) -> None:
    stage = Rejoining(ros, rejoin_wait_s=0.3)
    stage.send(60)
    assert stage.answer().tobytes() == stage.expected(60).tobytes()


def test_a_flight_heard_from_its_first_step_asks_nothing(ros: Ros) -> None:
    stage = Rejoining(ros, rejoin_wait_s=1000.0)
    stage.send(0)
    stage.answer()
    stage.send(1)
    ros.spin_until(lambda: len(stage.commands) == 2)
    assert stage.applied.get_subscription_count() == 0


def test_a_late_plant_sends_what_it_holds_with_the_state(ros: Ros) -> None:
    plant = ros.add(PlantNode(ros.context, overrides(command_timeout_s=0.2, command_retries=1000)))
    watcher = ros.partner("controller")
    sender = watcher.sends(topics.COMMAND)
    write = NamedValuesWriter(plant.grid, CONTROL_NAMES).fill
    answered: list[int] = []

    def answer(message: Any) -> None:
        k = plant.grid.step_of(message.header.stamp)
        if k < 5:
            answered.append(k)
            sender.publish(write(k, HELD))

    applied = watcher.hear(topics.APPLIED_COMMAND)
    watcher.hear(topics.STATE, answer)
    ros.spin_until(lambda: plant.sent_again == 2)
    ros.spin_until(lambda: [plant.grid.step_of(m.header.stamp) for m in applied] == [0, 1, 2, 3, 4, 4, 4])
    assert read_named_values(applied[-1], CONTROL_NAMES).tobytes() == plant._applied[:4].tobytes()
