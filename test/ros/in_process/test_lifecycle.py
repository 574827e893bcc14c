# SPDX-License-Identifier: Apache-2.0
"""Lifecycle: what each transition does, called as `ros2 lifecycle` calls it; and the diagnostics."""

import time
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetAvailableTransitions, GetState
from own_slots import cart_file
from ros_fixtures import JOINT_STATE, Ros
from std_srvs.srv import Trigger

from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.messages import read_named, read_outcome
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.lifecycle import RefusedError
from skydiver_utc.parameters import ParameterError, load_scenario

pytest_plugins = ("ros_fixtures",)

CONFIGURE, CLEANUP = Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_CLEANUP
ACTIVATE, DEACTIVATE = Transition.TRANSITION_ACTIVATE, Transition.TRANSITION_DEACTIVATE
SHUTDOWN_UNCONFIGURED = Transition.TRANSITION_UNCONFIGURED_SHUTDOWN
SHUTDOWN_ACTIVE = Transition.TRANSITION_ACTIVE_SHUTDOWN
KINDS = ("plant", "controller", "reference")


class Manager:
    """Calls a node's services from another node."""

    def __init__(self, ros: Ros, kind: str) -> None:
        self._ros = ros
        self._partner = ros.partner(f"manager_of_{kind}")
        self._node = kind

    def call(self, service: str, kind: Any, **fields: Any) -> Any:
        return self._partner.call(self._ros, f"{self._node}/{service}", kind, **fields)

    def state(self) -> str:
        return str(self.call("get_state", GetState).current_state.label)

    def transition(self, number: int) -> bool:
        return bool(self.call("change_state", ChangeState, transition=Transition(id=number)).success)


class Stage:
    """Nodes of one run, and what a spectator receives of it."""

    def __init__(self, ros: Ros, folder: Path, **settings: object) -> None:
        self.ros = ros
        self.given = {"scenario": cart_file(folder), **settings}
        self.spectator = ros.partner("spectator")
        self.states = self.spectator.receive(JOINT_STATE)
        self.outcomes = self.spectator.receive(topics.OUTCOME)

    def add(self, kind: str, **settings: object) -> Any:
        return self.ros.node(kind, self.given | settings)


@pytest.mark.parametrize("kind", KINDS)
def test_each_transition_leads_where_it_should_and_a_request_without_sense_nowhere(
    ros: Ros, tmp_path: Path, kind: str
) -> None:
    node = Stage(ros, tmp_path).add(kind, autostart=False)
    manager = Manager(ros, kind)
    assert manager.state() == "unconfigured"
    available = manager.call("get_available_transitions", GetAvailableTransitions).available_transitions
    assert {description.transition.label for description in available} == {"configure", "shutdown"}
    for number in (ACTIVATE, DEACTIVATE, CLEANUP, 200):
        assert not manager.transition(number)
    assert not manager.call("change_state", ChangeState, transition=Transition(label="jump")).success
    for number, state in ((CONFIGURE, "inactive"), (ACTIVATE, "active"), (DEACTIVATE, "inactive")):
        assert manager.transition(number)
        assert manager.state() == state
    assert manager.transition(CLEANUP)
    assert not node.finished
    assert manager.transition(SHUTDOWN_UNCONFIGURED)
    assert manager.state() == "finalized"
    assert node.finished
    assert node.close() == 0


def test_nodes_that_are_managed_run_twice_in_whatever_order(ros: Ros, tmp_path: Path) -> None:
    stage = Stage(ros, tmp_path, autostart=False)
    nodes = {kind: stage.add(kind) for kind in ("plant", "controller", "reference")}
    managers = {kind: Manager(ros, kind) for kind in nodes}
    wanted = simulate(load_scenario(str(stage.given["scenario"])))
    run_ids = set()
    for number in (1, 2):
        for transition in (CONFIGURE, ACTIVATE):
            assert all(manager.transition(transition) for manager in managers.values())
        ros.spin_until(
            lambda number=number: len(stage.outcomes) == number and len(stage.states) >= 51 * number
        )
        states = [read_named(m, wanted.plant.state_names) for m in stage.states[-51:]]
        assert np.array(states).tobytes() == wanted.states.tobytes()
        run_ids.add(read_outcome(stage.outcomes[-1].data)["run_id"])
        assert not managers["plant"].transition(ACTIVATE)
        for transition in (DEACTIVATE, CLEANUP):
            assert all(manager.transition(transition) for manager in managers.values())
        assert not managers["plant"].call("reset", Trigger).success
    assert len(run_ids) == 2
    assert not any(node.finished for node in nodes.values())


@pytest.mark.parametrize("kind", KINDS)
def test_a_run_that_pauses_goes_on_with_the_same_bits(ros: Ros, tmp_path: Path, kind: str) -> None:
    """Also where the controller or the reference pauses; nobody gives up meanwhile."""
    stage = Stage(ros, tmp_path)
    nodes = {each: stage.add(each) for each in ("reference", "controller")}
    nodes["plant"] = plant = stage.add("plant", command_timeout_s=0.2, command_retries=1000)
    ros.spin_until(lambda: plant.k >= 5)
    manager = Manager(ros, kind)
    assert manager.transition(DEACTIVATE)
    k, retransmitted = plant.k, plant.retransmitted
    if kind == "plant":
        ros.spin_for(0.6)
        assert (plant.k, plant.retransmitted) == (k, retransmitted)
    elif kind == "controller":
        ros.spin_until(lambda: plant.retransmitted >= 2)
    assert manager.transition(ACTIVATE)
    ros.spin_until(lambda: plant.done)
    wanted = simulate(load_scenario(str(stage.given["scenario"])))
    ros.spin_until(lambda: len(stage.states) == 51 + plant.retransmitted)
    by_step = {
        plant.grid.step_of(m.header.stamp): read_named(m, wanted.plant.state_names) for m in stage.states
    }
    assert np.array([by_step[i] for i in range(51)]).tobytes() == wanted.states.tobytes()


@pytest.mark.parametrize(
    ("transition", "number", "error"),
    [
        ("configure", CONFIGURE, ArithmeticError("not foreseen")),
        ("shutdown", SHUTDOWN_ACTIVE, RefusedError("not now")),
    ],
)
def test_an_error_of_the_program_or_a_refused_shutdown_ends_the_node(
    ros: Ros, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, transition: str, number: int, error: Exception
) -> None:
    node = Stage(ros, tmp_path).add("reference", autostart=number == SHUTDOWN_ACTIVE)
    monkeypatch.setattr(node, transition, Mock(side_effect=error))
    manager = Manager(ros, "reference")
    assert not manager.transition(number)
    assert manager.state() == "finalized"
    assert node.finished
    assert not node.active


def test_a_refused_node_leaves_nothing_behind(ros: Ros, tmp_path: Path) -> None:
    partner = ros.partner()
    with pytest.raises(ParameterError):
        ros.node("plant", {"scenario": cart_file(tmp_path), "mode": "fast"})
    ros.spin_until(lambda: "plant" not in partner.get_node_names())


def test_every_node_publishes_how_it_is_once_a_second(ros: Ros, tmp_path: Path) -> None:
    stage = Stage(ros, tmp_path)
    messages = stage.spectator.receive(topics.DIAGNOSTICS)
    stage.add("reference", autostart=False)
    plant = stage.add("plant")
    pushes = stage.spectator.publisher(topics.PUSH)
    ros.spin_until(pushes.get_subscription_count)
    pushes.publish(topics.PUSH.type(name=["nothing"]))
    ros.spin_until(lambda: plant.refusals.counts["names"])
    messages.clear()

    def statuses(name: str) -> list[Any]:
        return [
            status for message in messages for status in message.status if status.name == f"skydiver/{name}"
        ]

    ros.spin_until(lambda: len(statuses("plant")) >= 2 and statuses("reference"))
    values = {pair.key: pair.value for pair in statuses("plant")[-1].values}
    assert {"step", "lifecycle", "cpu_percent", "memory_MB", "last_refusal"} <= set(values)
    assert (values["step"], values["lifecycle"], values["refused_names"]) == (str(plant.k), "active", "1")
    assert float(values["memory_MB"]) > 1.0
    values = {pair.key: pair.value for pair in statuses("reference")[-1].values}
    assert values["lifecycle"] == "unconfigured"
    assert plant.grid.step_of(messages[0].header.stamp) == 0


@pytest.mark.parametrize(
    ("values", "age_s"),
    [({}, 0.0), ({"id": "another", "age_s": "old"}, 0.0), ({"id": "another", "age_s": "100.0"}, 11.0)],
)
def test_a_foreign_or_a_late_status_of_its_name_does_not_end_a_node(
    ros: Ros, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, values: dict[str, str], age_s: float
) -> None:
    """Only another node of this package makes a new node the second of its name; after 10 s it is not new."""
    stage = Stage(ros, tmp_path)
    reference = stage.add("reference")
    now_s = time.monotonic
    monkeypatch.setattr(time, "monotonic", lambda: now_s() + age_s)
    diagnostics = stage.spectator.publisher(topics.DIAGNOSTICS)
    ros.spin_until(lambda: diagnostics.get_subscription_count() and reference.active)
    pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
    status = DiagnosticStatus(name="skydiver/reference", values=pairs)
    clocks = stage.spectator.publisher(topics.CLOCK)
    ros.spin_until(clocks.get_subscription_count)
    diagnostics.publish(topics.DIAGNOSTICS.type(status=[status]))
    clocks.publish(topics.CLOCK.type())
    ros.spin_until(lambda: reference.refusals.counts["stamp"] == 1)
    assert reference.active
    assert not reference.refused


def test_a_plant_beside_one_of_another_name_is_refused(ros: Ros, tmp_path: Path) -> None:
    ros.partner("own_plant").publisher(JOINT_STATE)
    plant = Stage(ros, tmp_path).add("plant")
    ros.spin_until(lambda: plant.finished)
    assert "own_plant" in plant.refused
    assert "/skydiver/state" in plant.refused
