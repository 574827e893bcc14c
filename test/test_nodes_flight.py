"""Whole flights over ROS against the same flights in process: equal bit for bit."""

import json
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message
from ros_fixtures import Processes, Ros, overrides

from skydiver_utc.nodes import topics
from skydiver_utc.nodes.bag_recorder import RecorderNode
from skydiver_utc.nodes.lockstep_controller import ControllerNode
from skydiver_utc.nodes.lockstep_plant import PlantNode
from skydiver_utc.nodes.messages import SETPOINT_AXES, read_named_values, read_state
from skydiver_utc.nodes.preview_publisher import ReferenceNode
from skydiver_utc.nodes.stamps import StepGrid
from skydiver_utc.nodes.topics import Topic
from skydiver_utc.parameters import Scenario, load_scenario
from skydiver_utc.plant.skydiver import CONTROL_NAMES
from skydiver_utc.simulation.closed_loop import simulate
from skydiver_utc.simulation.outcome import Outcome

pytest_plugins = ("ros_fixtures",)


class Bag:
    """What a run folder holds, by topic and step."""

    def __init__(self, folder: Path, namespace: str = "/skydiver") -> None:
        self._namespace = namespace
        self.scenario = load_scenario(str(folder / "scenario.yaml"))
        self._grid = StepGrid(self.scenario)
        self._path = next(folder.glob("*.mcap"))
        assert (folder / "metadata.yaml").is_file()

    def of(self, topic: Topic) -> list[Any]:
        name = topic.name if topic.name.startswith("/") else f"{self._namespace}/{topic.name}"
        with self._path.open("rb") as stream:
            messages = make_reader(stream).iter_messages(topics=[name])
            return [deserialize_message(message.data, topic.type) for _, _, message in messages]

    def steps(self, topic: Topic) -> list[int]:
        stamps = [m.clock if topic is topics.CLOCK else m.header.stamp for m in self.of(topic)]
        return [self._grid.step_of(stamp) for stamp in stamps]

    def states(self) -> NDArray[np.float64]:
        return np.array([read_state(message) for message in self.of(topics.STATE)])

    def controls(self, topic: Topic) -> NDArray[np.float64]:
        return np.array([read_named_values(message, CONTROL_NAMES) for message in self.of(topic)])

    def outcome(self) -> dict[str, Any]:
        (message,) = self.of(topics.OUTCOME)
        return dict(json.loads(message.data))


def assert_complete(bag: Bag) -> None:
    """Every step of every topic that has one a step, once and in order."""
    states = list(range(bag.scenario.steps + 1))
    for topic in topics.RECORDED:
        if topic is topics.SETPOINT and bag.scenario.reference.signal not in SETPOINT_AXES:
            assert bag.of(topic) == []
        elif topic.fewer_than_states is not None:
            expected = states[: len(states) - topic.fewer_than_states]
            assert bag.steps(topic) == expected, topic.name
    assert len(bag.of(topics.SCENARIO)) == 1


def assert_equals_simulation(bag: Bag, scenario: Scenario) -> None:
    assert bag.scenario == scenario
    flight = simulate(scenario)
    assert bag.states().tobytes() == flight.states.tobytes()
    assert bag.controls(topics.COMMAND).tobytes() == flight.commands.tobytes()
    assert bag.controls(topics.APPLIED_COMMAND).tobytes() == flight.applied.tobytes()
    signal = scenario.reference.signal
    if signal in SETPOINT_AXES:
        axis = SETPOINT_AXES[signal]
        sent = [getattr(m.twist.angular, axis) for m in bag.of(topics.SETPOINT)]
        assert sent == flight.reference.tolist()
    telemetry = np.array([m.position for m in bag.of(topics.TELEMETRY)])
    assert telemetry[:, :-2].tobytes() == flight.telemetry.tobytes()
    assert list(bag.of(topics.TELEMETRY)[0].name) == [*flight.telemetry_names, "solve_time", "status"]
    assert bag.outcome()["outcome"] == flight.outcome.value
    assert bag.outcome()["reason"] == flight.reason


@pytest.mark.parametrize(
    "scenario",
    ["fast_turn_unknown_dynamics", "fast_turn_pose_only", "front_layout", "back_layout_open_loop"],
    ids=["utc", "pose", "pitch rate", "open loop"],
)
def test_a_flight_on_one_executor_equals_the_simulation(ros: Ros, tmp_path: Path, scenario: str) -> None:
    given = overrides(0.5, scenario=scenario, wait_for_recorder=True)
    folder = tmp_path / "bag"
    recorder = ros.add(RecorderNode(ros.context, overrides(0.5, scenario=scenario, bag_folder=str(folder))))
    nodes = [ros.add(kind(ros.context, given)) for kind in (PlantNode, ReferenceNode, ControllerNode)]
    ros.spin_until(lambda: recorder.finished and not recorder.missing())
    assert [node.close() for node in (*nodes, recorder)] == [0, 0, 0, 0]
    assert_complete(Bag(folder))
    assert_equals_simulation(Bag(folder), load_scenario(scenario, {"duration_s": 0.5}))


def test_a_flight_that_ends_early_equals_the_simulation(ros: Ros, tmp_path: Path) -> None:
    """A flight that is stopped is recorded up to its last state, and is the simulated one up to there."""
    given = overrides(0.3, wait_for_recorder=True)
    folder = tmp_path / "bag"
    plant = ros.add(PlantNode(ros.context, given))
    recorder = ros.add(RecorderNode(ros.context, overrides(0.3, bag_folder=str(folder))))
    for kind in (ReferenceNode, ControllerNode):
        ros.add(kind(ros.context, given))
    ros.spin_until(lambda: plant.k >= 20)
    assert plant.close() == 0
    ros.spin_until(lambda: recorder.finished)
    assert recorder.close() == 0
    bag = Bag(folder)
    flight = simulate(load_scenario("fast_turn_unknown_dynamics", {"duration_s": 0.3}))
    assert bag.outcome()["outcome"] == "aborted"
    assert bag.states().tobytes() == flight.states[: plant.k + 1].tobytes()
    assert bag.controls(topics.APPLIED_COMMAND).tobytes() == flight.applied[: plant.k].tobytes()


def test_a_second_flight_is_served_by_the_same_controller_and_reference(ros: Ros) -> None:
    for kind in (ReferenceNode, ControllerNode):
        ros.add(kind(ros.context, overrides(0.6)))
    ends = []
    for _ in range(2):
        plant = ros.add(PlantNode(ros.context, overrides(0.6)))
        ros.spin_until(lambda plant=plant: plant.finished)  # type: ignore[misc]
        assert plant.outcome is Outcome.COMPLETED
        ends.append(plant._state.tobytes())
        ros.remove(plant)
    flight = simulate(load_scenario("fast_turn_unknown_dynamics", {"duration_s": 0.6}))
    assert ends == [flight.states[-1].tobytes()] * 2


def test_a_controller_that_starts_late_finds_the_reference(ros: Ros) -> None:
    plant = ros.add(PlantNode(ros.context, overrides(0.6, command_timeout_s=0.3, command_retries=1000)))
    ros.add(ReferenceNode(ros.context, overrides(0.6, chunk_steps=20)))
    first = ros.add(ControllerNode(ros.context, overrides(0.6)))
    ros.spin_until(lambda: plant.k >= 70)
    ros.remove(first)
    ros.add(ControllerNode(ros.context, overrides(0.6)))
    ros.spin_until(lambda: plant.finished)
    assert (plant.outcome, plant.k) == (Outcome.COMPLETED, plant.scenario.steps)


def test_four_processes_equal_the_simulation(processes: Processes, tmp_path: Path) -> None:
    folder, given = tmp_path / "bag", overrides(1.0)
    waiting = given | {"wait_for_recorder": True}
    recorder = processes.start("recorder", given | {"bag_folder": folder})
    servers = [processes.start(kind, waiting) for kind in ("controller", "reference")]
    plant = processes.start("plant", waiting | {"progress": True})
    assert plant.wait() == 0, plant.output
    assert recorder.wait() == 0, recorder.output
    for server, number in zip(servers, (signal.SIGINT, signal.SIGTERM), strict=True):
        server.signal(number)
        assert server.wait() == 0, server.output
    reports = plant.reports()
    assert reports[0] == {"step": 119, "steps": 239}
    assert reports[-1]["outcome"] == "completed"
    assert_complete(Bag(folder))
    assert_equals_simulation(Bag(folder), load_scenario("fast_turn_unknown_dynamics", {"duration_s": 1.0}))


class RecordedFlight:
    """A recorder process, all other nodes in this process."""

    def __init__(self, ros: Ros, processes: Processes, folder: Path, duration_s: float) -> None:
        given = overrides(duration_s)
        self.ros = ros
        self.folder = folder
        self.recorder = processes.start("recorder", given | {"bag_folder": folder})
        waiting = given | {"wait_for_recorder": True}
        ros.add(ReferenceNode(ros.context, waiting))
        ros.add(ControllerNode(ros.context, waiting))
        self.plant: PlantNode = ros.add(PlantNode(ros.context, waiting))

    def until_step(self, k: int) -> None:
        self.ros.spin_until(lambda: self.plant.k >= k)

    def until_recorded(self) -> Bag:
        self.ros.spin_until(lambda: self.recorder.ended)
        assert self.recorder.wait() == 0, self.recorder.output
        assert "Traceback" not in self.recorder.output
        return Bag(self.folder)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=["SIGINT", "SIGTERM"])
def test_a_recorder_that_is_stopped_leaves_a_whole_bag(
    ros: Ros, processes: Processes, tmp_path: Path, number: signal.Signals
) -> None:
    """Stopped when the flight has just ended, twice even: the bag has every step all the same."""
    flight = RecordedFlight(ros, processes, tmp_path / "bag", 0.5)
    ros.spin_until(lambda: flight.plant.finished)
    flight.recorder.signal(number)
    flight.recorder.signal(signal.SIGINT)
    assert_complete(flight.until_recorded())


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=["SIGINT", "SIGTERM"])
def test_a_recorder_that_is_stopped_in_flight_leaves_a_readable_bag(
    ros: Ros, processes: Processes, tmp_path: Path, number: signal.Signals
) -> None:
    flight = RecordedFlight(ros, processes, tmp_path / "bag", 600.0)
    flight.until_step(100)
    flight.recorder.signal(number)
    steps = flight.until_recorded().steps(topics.STATE)
    assert steps[:100] == list(range(100))
    assert steps == sorted(steps)


def test_a_recorder_that_was_held_up_misses_nothing(ros: Ros, processes: Processes, tmp_path: Path) -> None:
    """With the usual depth of 10 at the senders, more than a hundred steps would be missing."""
    flight = RecordedFlight(ros, processes, tmp_path / "bag", 2.0)
    flight.until_step(50)
    flight.recorder.signal(signal.SIGSTOP)
    flight.until_step(400)
    flight.recorder.signal(signal.SIGCONT)
    assert_complete(flight.until_recorded())


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=["SIGINT", "SIGTERM"])
def test_a_plant_that_is_stopped_says_aborted(ros: Ros, processes: Processes, number: signal.Signals) -> None:
    for kind in (ReferenceNode, ControllerNode):
        ros.add(kind(ros.context, overrides(600.0)))
    listener = ros.partner("listener")
    states, outcomes = listener.hear(topics.STATE), listener.hear(topics.OUTCOME)
    plant = processes.start("plant", overrides(600.0))
    grid = StepGrid(load_scenario("fast_turn_unknown_dynamics", {"duration_s": 600.0}))
    ros.spin_until(lambda: states and grid.step_of(states[-1].header.stamp) > 20)
    plant.signal(number)
    plant.signal(number)
    ros.spin_until(lambda: outcomes and plant.ended)
    assert plant.wait() == 0, plant.output
    assert "Traceback" not in plant.output
    told = json.loads(outcomes[0].data)
    assert told["outcome"] == "aborted"
    assert told["states"] > 20


def test_a_controller_that_dies_ends_the_flight(ros: Ros, processes: Processes) -> None:
    ros.add(ReferenceNode(ros.context, overrides(600.0)))
    plant = ros.add(PlantNode(ros.context, overrides(600.0, command_timeout_s=0.2, command_retries=1)))
    controller = processes.start("controller", overrides(600.0))
    ros.spin_until(lambda: plant.k > 20)
    controller.kill()
    ros.spin_until(lambda: plant.finished)
    assert plant.outcome is Outcome.NO_COMMAND
    assert f"no command for step {plant.k}" in plant.reason


@pytest.mark.parametrize("kind", ["plant", "controller", "reference", "recorder"])
def test_a_node_that_waits_for_the_others_can_be_stopped(processes: Processes, kind: str) -> None:
    node = processes.start(kind, overrides())
    node.wait_for_output("scenario fast_turn_unknown_dynamics")
    node.signal(signal.SIGINT)
    assert node.wait() == 0
    assert "Traceback" not in node.output
