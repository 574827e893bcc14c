"""Managed nodes: what each transition does, called as `ros2 lifecycle` calls it."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetAvailableTransitions, GetState
from ros_fixtures import Partner, Processes, Ros, overrides
from test_nodes_flight import Bag, assert_complete, assert_equals_simulation

from skydiver_utc.analysis.recorded_flight import read_flight
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.bag_recorder import RecorderNode
from skydiver_utc.nodes.lockstep_controller import ControllerNode
from skydiver_utc.nodes.lockstep_plant import PlantNode
from skydiver_utc.nodes.preview_publisher import ReferenceNode
from skydiver_utc.parameters import ParameterError, load_scenario
from skydiver_utc.simulation.closed_loop import simulate
from skydiver_utc.simulation.outcome import Outcome

pytest_plugins = ("ros_fixtures",)

CONFIGURE, CLEANUP = Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_CLEANUP
ACTIVATE, DEACTIVATE = Transition.TRANSITION_ACTIVATE, Transition.TRANSITION_DEACTIVATE
SHUTDOWN = {
    "unconfigured": Transition.TRANSITION_UNCONFIGURED_SHUTDOWN,
    "inactive": Transition.TRANSITION_INACTIVE_SHUTDOWN,
    "active": Transition.TRANSITION_ACTIVE_SHUTDOWN,
}
KINDS = {
    "plant": PlantNode,
    "controller": ControllerNode,
    "reference": ReferenceNode,
    "recorder": RecorderNode,
}


class Manager:
    """Calls a node's services from another node, as `ros2 lifecycle` does."""

    def __init__(self, ros: Ros, kind: str, namespace: str = "/skydiver") -> None:
        self._ros = ros
        self._partner: Partner = ros.partner(f"manager_of_{kind}")
        self._node = f"{namespace}/{kind}"
        self._clients: dict[str, Any] = {}

    def call(self, service: str, kind: Any, **fields: Any) -> Any:
        if service not in self._clients:
            self._clients[service] = self._partner.create_client(kind, f"{self._node}/{service}")
            self._ros.spin_until(self._clients[service].service_is_ready)
        future = self._clients[service].call_async(kind.Request(**fields))
        self._ros.spin_until(future.done)
        return future.result()

    def state(self) -> str:
        return str(self.call("get_state", GetState).current_state.label)

    def transition(self, number: int) -> bool:
        return bool(self.call("change_state", ChangeState, transition=Transition(id=number)).success)

    def transitions(self) -> set[str]:
        response = self.call("get_available_transitions", GetAvailableTransitions)
        return {description.transition.label for description in response.available_transitions}


class Stage:
    """Nodes of one flight in this process, by kind."""

    def __init__(self, ros: Ros, duration_s: float = 0.3, **parameters: object) -> None:
        self.ros = ros
        self.given = overrides(duration_s, **parameters)
        self.nodes: dict[str, Any] = {}

    def add(self, *kinds: str, **parameters: object) -> Any:
        for kind in kinds:
            self.nodes[kind] = self.ros.add(KINDS[kind](self.ros.context, self.given | parameters))
        return self.nodes[kinds[-1]]


@pytest.mark.parametrize("kind", KINDS)
def test_a_node_manages_itself_unless_told_otherwise(ros: Ros, tmp_path: Path, kind: str) -> None:
    own = {"bag_folder": str(tmp_path / "bag")} if kind == "recorder" else {}
    Stage(ros).add(kind, **own)
    manager = Manager(ros, kind)
    assert manager.state() == "active"
    assert manager.transitions() == {"deactivate", "shutdown"}


@pytest.mark.parametrize("kind", KINDS)
def test_each_transition_is_answered_and_leads_where_it_should(ros: Ros, tmp_path: Path, kind: str) -> None:
    own = {"bag_folder": str(tmp_path / "bag")} if kind == "recorder" else {}
    node = Stage(ros).add(kind, autostart=False, **own)
    manager = Manager(ros, kind)
    assert manager.state() == "unconfigured"
    assert manager.transitions() == {"configure", "shutdown"}
    for number, state in ((CONFIGURE, "inactive"), (ACTIVATE, "active"), (DEACTIVATE, "inactive")):
        assert manager.transition(number)
        assert manager.state() == state
    assert manager.transition(CLEANUP)
    assert manager.state() == "unconfigured"
    assert not node.finished
    assert manager.transition(SHUTDOWN["unconfigured"])
    assert manager.state() == "finalized"
    assert node.finished
    assert node.close() == 0


def test_a_transition_that_does_not_exist_now_is_refused_and_the_node_lives(ros: Ros) -> None:
    Stage(ros).add("controller", autostart=False)
    manager = Manager(ros, "controller")
    for number in (ACTIVATE, DEACTIVATE, CLEANUP, 200):
        assert not manager.transition(number)
    assert not manager.call("change_state", ChangeState, transition=Transition(label="jump")).success
    assert manager.state() == "unconfigured"
    assert manager.transition(CONFIGURE)


def test_nodes_that_are_managed_fly_as_others_do(ros: Ros, tmp_path: Path) -> None:
    """In an order in which nobody would start them."""
    stage = Stage(ros, wait_for_recorder=True, autostart=False)
    folder = tmp_path / "bag"
    for kind in ("plant", "controller", "reference"):
        stage.add(kind)
    stage.given.pop("wait_for_recorder")
    recorder = stage.add("recorder", bag_folder=str(folder))
    managers = {kind: Manager(ros, kind) for kind in stage.nodes}
    for number in (CONFIGURE, ACTIVATE):
        for manager in managers.values():
            assert manager.transition(number)
    ros.spin_until(lambda: recorder.done and not recorder.missing())
    assert not any(node.finished for node in stage.nodes.values())
    assert managers["recorder"].transition(DEACTIVATE)
    assert managers["recorder"].transition(CLEANUP)
    assert_complete(Bag(folder))
    assert_equals_simulation(Bag(folder), load_scenario("fast_turn_unknown_dynamics", {"duration_s": 0.3}))


def assert_flown_as_simulated(folder: Path, duration_s: float) -> None:
    """States and commands, those counted once that a busy machine made the plant send again."""
    found = read_flight(folder)
    wanted = simulate(load_scenario("fast_turn_unknown_dynamics", {"duration_s": duration_s}))
    assert found.outcome is Outcome.COMPLETED
    assert found.states.tobytes() == wanted.states.tobytes()
    assert found.commands.tobytes() == wanted.commands.tobytes()


def test_a_flight_that_pauses_goes_on_with_the_same_bits(ros: Ros, tmp_path: Path) -> None:
    """Longer than all time-outs for a command together: nothing is sent again, nobody gives up."""
    stage = Stage(ros, 2.0, wait_for_recorder=True)
    plant = stage.add("plant", command_timeout_s=0.5, command_retries=1)
    stage.add("controller")
    stage.add("reference")
    stage.given.pop("wait_for_recorder")
    folder = tmp_path / "bag"
    recorder = stage.add("recorder", bag_folder=str(folder))
    ros.spin_until(lambda: plant.k >= 40)
    manager = Manager(ros, "plant")
    assert manager.transition(DEACTIVATE)
    k, sent_again = plant.k, plant.sent_again
    health = ros.partner("doctor").hear(topics.DIAGNOSTICS)
    ros.spin_for(2.0)
    assert plant.k == k < plant.scenario.steps
    assert plant.sent_again == sent_again
    assert not plant.done
    told = [status for message in health for status in message.status if status.name == "skydiver/plant"]
    values = {pair.key: pair.value for pair in told[-1].values}
    assert (values["lifecycle"], told[-1].message) == ("inactive", f"inactive, newest step {k}")
    assert manager.transition(ACTIVATE)
    ros.spin_until(lambda: recorder.finished and not recorder.missing())
    assert recorder.close() == 0
    assert_flown_as_simulated(folder, 2.0)


def test_a_command_that_comes_in_a_pause_is_used_after_it(ros: Ros) -> None:
    stage = Stage(ros, command_timeout_s=50.0)
    plant = stage.add("plant")
    partner = ros.partner("controller")
    sender = partner.sends(topics.COMMAND)
    states = partner.hear(topics.STATE)
    ros.spin_until(lambda: plant.k == 0)
    manager = Manager(ros, "plant")
    assert manager.transition(DEACTIVATE)
    sender.publish(plant._write_applied(0, np.array([0.5, 0.0, 0.0, 0.1])))
    ros.spin_until(lambda: plant._ready is not None)
    assert plant.k == 0
    assert manager.transition(ACTIVATE)
    assert plant.k == 1
    ros.spin_until(lambda: len(states) == 2)


@pytest.mark.parametrize("state", ["active", "inactive"])
def test_a_flight_that_is_shut_down_is_aborted_and_says_so(ros: Ros, state: str) -> None:
    stage = Stage(ros, 60.0)
    stage.add("controller", "reference")
    plant = stage.add("plant")
    outcomes = ros.partner("listener").hear(topics.OUTCOME)
    ros.spin_until(lambda: plant.k >= 20)
    manager = Manager(ros, "plant")
    if state == "inactive":
        assert manager.transition(DEACTIVATE)
    assert manager.transition(SHUTDOWN[state])
    ros.spin_until(lambda: outcomes)
    told = json.loads(outcomes[0].data)
    assert told["outcome"] == "aborted"
    assert told["reason"] == f"shut down at step {plant.k}"
    assert plant.finished
    assert plant.close() == 0


def test_a_plant_that_was_cleaned_up_flies_again(ros: Ros) -> None:
    """First a flight that ends by the clean-up, then a whole one, then that is over until the next clean-up."""
    stage = Stage(ros, 2.0, autostart=False)
    stage.given["autostart"] = True
    stage.add("controller", "reference")
    plant = stage.add("plant", autostart=False)
    outcomes = ros.partner("listener").hear(topics.OUTCOME)
    manager = Manager(ros, "plant")
    assert manager.transition(CONFIGURE)
    assert manager.transition(ACTIVATE)
    ros.spin_until(lambda: plant.k >= 20)
    assert manager.transition(DEACTIVATE)
    k = plant.k
    assert manager.transition(CLEANUP)
    ros.spin_until(lambda: outcomes)
    assert json.loads(outcomes[0].data)["reason"] == f"cleaned up at step {k}"
    for number in (CONFIGURE, ACTIVATE):
        assert manager.transition(number)
    ros.spin_until(lambda: plant.done)
    assert plant.outcome is Outcome.COMPLETED
    flight = simulate(load_scenario("fast_turn_unknown_dynamics", {"duration_s": 2.0}))
    assert plant._state.tobytes() == flight.states[-1].tobytes()
    assert not plant.finished
    assert manager.transition(DEACTIVATE)
    assert not manager.transition(ACTIVATE)
    assert "the flight is over" in plant.last_transition
    assert manager.state() == "inactive"


def test_a_flight_in_real_time_does_not_pause(ros: Ros) -> None:
    stage = Stage(ros, 60.0, mode="real_time")
    stage.add("controller")
    plant = stage.add("plant")
    stage.given.pop("mode")
    stage.add("reference")
    ros.spin_until(lambda: plant.k >= 20)
    manager = Manager(ros, "plant")
    assert not manager.transition(DEACTIVATE)
    assert plant.last_transition == (
        "deactivate refused: a flight in real time cannot pause: shut the plant down to end it"
    )
    assert manager.state() == "active"
    k = plant.k
    ros.spin_until(lambda: plant.k > k)


def test_a_controller_that_was_inactive_answers_nothing_and_goes_on(ros: Ros) -> None:
    """It missed no step of the lockstep flight, so the flight is the simulated one."""
    stage = Stage(ros, 2.0)
    plant = stage.add("plant", command_timeout_s=0.3, command_retries=1000)
    controller = stage.add("reference", "controller")
    ros.spin_until(lambda: plant.k >= 40)
    manager = Manager(ros, "controller")
    assert manager.transition(DEACTIVATE)
    ros.spin_until(lambda: plant.retries > 0)
    k, answered = plant.k, controller.answered
    ros.spin_for(1.0)
    assert (plant.k, controller.answered) == (k, answered)
    assert plant.sent_again > 0
    assert manager.transition(ACTIVATE)
    ros.spin_until(lambda: plant.done)
    flight = simulate(load_scenario("fast_turn_unknown_dynamics", {"duration_s": 2.0}))
    assert plant._state.tobytes() == flight.states[-1].tobytes()


def test_a_controller_that_was_cleaned_up_in_flight_rejoins(ros: Ros) -> None:
    stage = Stage(ros, 2.0)
    plant = stage.add("plant", command_timeout_s=0.3, command_retries=1000)
    stage.add("reference", "controller")
    changes = ros.partner("listener").hear(topics.CHANGES)
    ros.spin_until(lambda: plant.k >= 40)
    manager = Manager(ros, "controller")
    assert all(manager.transition(number) for number in (DEACTIVATE, CLEANUP, CONFIGURE, ACTIVATE))
    held = plant._applied[:4].tolist()
    k = plant.k
    ros.spin_until(lambda: plant.done and changes)
    assert plant.outcome is Outcome.COMPLETED
    assert [json.loads(message.data) for message in changes] == [
        {"node": "controller", "step": k, "parameters": {}, "control": held}
    ]


def test_an_inactive_reference_is_silent_and_makes_up_for_it(ros: Ros) -> None:
    stage = Stage(ros, 4.0)
    plant = stage.add("plant", command_timeout_s=0.2, command_retries=1000)
    stage.add("controller")
    stage.add("reference", chunk_steps=10)
    ros.spin_until(lambda: plant.k >= 20)
    manager = Manager(ros, "reference")
    assert manager.transition(DEACTIVATE)
    ros.spin_until(lambda: plant.retries > 1)
    k = plant.k
    assert k < plant.scenario.steps
    ros.spin_for(0.5)
    assert plant.k == k
    assert manager.transition(ACTIVATE)
    ros.spin_until(lambda: plant.done)
    flight = simulate(load_scenario("fast_turn_unknown_dynamics", {"duration_s": 4.0}))
    assert plant._state.tobytes() == flight.states[-1].tobytes()


def test_what_an_inactive_recorder_hears_is_not_recorded_but_latched_messages_are(
    ros: Ros, tmp_path: Path
) -> None:
    stage = Stage(ros, 2.0)
    plant = stage.add("plant", command_timeout_s=50.0)
    folder = tmp_path / "bag"
    recorder = stage.add("recorder", autostart=False, bag_folder=str(folder))
    manager = Manager(ros, "recorder")
    assert manager.transition(CONFIGURE)
    assert (folder / "scenario.yaml").is_file()
    stage.add("controller", "reference")
    ros.spin_until(lambda: plant.k >= 20)
    pause = Manager(ros, "plant")
    assert pause.transition(DEACTIVATE)
    ros.spin_for(0.3)
    first = plant.k
    assert recorder.not_recorded > first
    assert manager.transition(ACTIVATE)
    assert pause.transition(ACTIVATE)
    ros.spin_until(lambda: plant.done and recorder.done)
    ros.spin_for(0.3)
    assert manager.transition(DEACTIVATE)
    assert manager.transition(CLEANUP)
    bag = Bag(folder)
    assert bag.steps(topics.STATE) == list(range(first + 1, plant.scenario.steps + 1))
    assert len(bag.of(topics.SCENARIO)) == len(bag.of(topics.OUTCOME)) == 1


def test_a_bag_that_cannot_be_made_leaves_the_recorder_unconfigured(ros: Ros, tmp_path: Path) -> None:
    folder = tmp_path / "bag"
    folder.mkdir()
    recorder = Stage(ros).add("recorder", autostart=False, bag_folder=str(folder))
    manager = Manager(ros, "recorder")
    assert not manager.transition(CONFIGURE)
    assert f"configure refused: {folder} exists already" in recorder.last_transition
    assert manager.state() == "unconfigured"
    folder.rmdir()
    assert manager.transition(CONFIGURE)
    assert manager.state() == "inactive"
    assert recorder.close() == 0


def test_an_error_of_the_program_finalizes_the_node_and_is_not_hidden(
    ros: Ros, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(_: Any) -> None:
        raise KeyError("a bug")

    monkeypatch.setattr(PlantNode, "rebuilt", broken)
    plant = Stage(ros).add("plant", autostart=False)
    manager = Manager(ros, "plant")
    assert not manager.transition(CONFIGURE)
    assert manager.state() == "finalized"
    assert "TypeError" in plant.last_transition
    assert plant.finished
    assert plant.close() == 0


def test_what_goes_wrong_at_the_start_of_a_node_that_manages_itself_is_raised(
    ros: Ros, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refusing(_node: Any, _scenario: Any) -> None:
        raise ParameterError("no such plant")

    monkeypatch.setattr(PlantNode, "rebuilt", refusing)
    partner = ros.partner()
    with pytest.raises(ParameterError, match="no such plant"):
        PlantNode(ros.context, overrides())
    ros.spin_for(0.1)
    assert partner.get_node_names() == ["partner"]


def test_processes_are_managed_from_outside(ros: Ros, processes: Processes, tmp_path: Path) -> None:
    """All four as processes that wait for transitions, a pause in flight, shut down at the end."""
    folder, given = tmp_path / "bag", overrides(20.0, autostart=False)
    waiting = given | {"wait_for_recorder": True}
    started = {
        "plant": processes.start("plant", waiting),
        "controller": processes.start("controller", waiting),
        "reference": processes.start("reference", waiting),
        "recorder": processes.start("recorder", given | {"bag_folder": folder}),
    }
    managers = {kind: Manager(ros, kind) for kind in started}
    states = ros.partner("listener").hear(topics.STATE)
    for number in (CONFIGURE, ACTIVATE):
        for kind in ("recorder", "reference", "controller", "plant"):
            assert managers[kind].transition(number), started[kind].output
    ros.spin_until(lambda: len(states) > 30)
    assert managers["plant"].transition(DEACTIVATE)
    ros.spin_for(3.0)
    assert managers["plant"].transition(ACTIVATE)
    started["plant"].wait_for_output("completed: ")
    for kind in ("plant", "controller", "reference", "recorder"):
        assert managers[kind].transition(SHUTDOWN["active"])
        assert started[kind].wait() == 0, started[kind].output
        assert "Traceback" not in started[kind].output
    assert_flown_as_simulated(folder, 20.0)
