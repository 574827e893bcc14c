# SPDX-License-Identifier: Apache-2.0
"""Nodes as processes: a second one of a kind, and each one killed and started again during a run."""

import json
import shutil
import signal
from pathlib import Path
from typing import Any

import numpy as np
import own_slots
import pytest
from own_slots import cart_file
from ros_fixtures import JOINT_STATE, Processes, Ros, Spectator, overrides

from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.messages import read_named, read_outcome
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.process import REFUSED
from skydiver_utc.parameters import load_scenario

pytest_plugins = ("ros_fixtures",)
pytestmark = pytest.mark.processes


class Stage:
    """The nodes of a cart, and a spectator that slows the run down to a pace at which a node can be killed."""

    def __init__(self, ros: Ros, processes: Processes, folder: Path) -> None:
        shutil.copy(own_slots.__file__, folder)
        self.ros, self._processes = ros, processes
        self.given: dict[str, Any] = {"scenario": cart_file(folder), "duration_s": 20.0}
        self.spectator = ros.add(Spectator(ros.context, JOINT_STATE))
        self.states = self.spectator.received[topics.STATE]
        self.commands = self.spectator.received[topics.COMMAND]
        self.changes = self.spectator.received[topics.CHANGES]
        self.outcomes = self.spectator.received[topics.OUTCOME]
        self.nodes: dict[str, Any] = {}

    def start(self, *kinds: str, **settings: object) -> None:
        for kind in kinds:
            # They begin when the spectator is matched, so that it misses no message.
            self.nodes[kind] = self._processes.start(
                kind, self.given | {"wait_for_recorder": True} | settings
            )

    def start_all(self, **settings: object) -> None:
        self.start("reference", "controller")
        self.start("plant", command_timeout_s=0.3, command_retries=200, **settings)
        self.ros.spin_until(lambda: len(self.states) > 50)

    def outcome(self, number: int = 1) -> dict[str, Any]:
        self.ros.spin_until(lambda: len(self.outcomes) >= number)
        return read_outcome(self.outcomes[-1].data)

    def step_of(self, message: Any) -> int:
        since_ns = (message.header.stamp.sec - 1_767_225_600) * 10**9 + message.header.stamp.nanosec
        return int(since_ns // 10_000_000)


@pytest.fixture
def stage(ros: Ros, processes: Processes, tmp_path: Path) -> Stage:
    return Stage(ros, processes, tmp_path)


@pytest.mark.parametrize("kind", ["plant", "controller", "reference"])
def test_a_second_node_of_a_kind_is_refused_with_one_sentence(stage: Stage, kind: str) -> None:
    stage.start(kind)
    topic = {"plant": "state", "controller": "command", "reference": "reference"}[kind]
    stage.ros.spin_until(lambda: stage.spectator.count_publishers(f"/skydiver/{topic}"))
    first = stage.nodes[kind]
    stage.start(kind)
    assert stage.nodes[kind].wait() == REFUSED
    last = stage.nodes[kind].output.splitlines()[-1]
    assert last.startswith(f"{kind}_node: ")
    assert f"/skydiver/{topic}" in last
    assert not first.ended


def test_a_second_plant_in_another_namespace_is_none(stage: Stage, processes: Processes) -> None:
    stage.start("plant")
    stage.ros.spin_until(lambda: stage.spectator.count_publishers("/skydiver/state"))
    processes.start("plant", stage.given, namespace="/other", ros_arguments=("-r", "/clock:=clock"))
    stage.ros.spin_until(lambda: stage.spectator.count_publishers("/other/state"))
    assert stage.spectator.count_publishers("/other/clock") == 1
    assert stage.spectator.count_publishers("/clock") == 1


def test_a_controller_killed_and_started_again_begins_from_the_applied_command(stage: Stage) -> None:
    stage.start_all()
    stage.nodes["controller"].kill()
    stage.start("controller")
    stage.ros.spin_until(lambda: stage.changes)
    assert stage.outcome()["outcome"] == "completed"
    change = json.loads(stage.changes[0].data)
    names = ("force", "brake")
    held = {stage.step_of(m): read_named(m, names) for m in stage.commands}[change["step"] - 1]
    np.testing.assert_allclose(change["control"], held, rtol=1e-12)
    assert stage.nodes["plant"].wait() == 0


def test_a_reference_killed_and_started_again_changes_no_bit(stage: Stage) -> None:
    stage.start_all()
    stage.nodes["reference"].kill()
    stage.start("reference")
    assert stage.outcome()["outcome"] == "completed"
    wanted = simulate(load_scenario(stage.given["scenario"], {"duration_s": 20.0}))
    stage.ros.spin_until(lambda: stage.step_of(stage.states[-1]) == 2000)
    by_step = {stage.step_of(m): read_named(m, ("position", "speed")) for m in stage.states}
    assert np.array([by_step[k] for k in range(2001)]).tobytes() == wanted.states.tobytes()


def test_a_plant_killed_and_started_again_begins_a_new_run(stage: Stage) -> None:
    stage.start_all()
    stage.nodes["plant"].kill()
    stage.start("plant")
    found = stage.outcome()
    assert (found["outcome"], found["states"]) == ("completed", 2001)
    wanted = simulate(load_scenario(stage.given["scenario"], {"duration_s": 20.0}))
    stage.ros.spin_until(lambda: stage.step_of(stage.states[-1]) == 2000)
    steps = [stage.step_of(m) for m in stage.states]
    begins = len(steps) - 1 - steps[::-1].index(0)  # a busy machine may have had a state retransmitted since
    by_step = {stage.step_of(m): read_named(m, ("position", "speed")) for m in stage.states[begins:]}
    assert np.array([by_step[k] for k in range(2001)]).tobytes() == wanted.states.tobytes()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_plant_that_is_interrupted_ends_the_run_and_exits_with_0(
    stage: Stage, number: signal.Signals
) -> None:
    stage.start_all()
    stage.nodes["plant"].signal(number)
    assert stage.nodes["plant"].wait() == 0
    assert stage.outcome()["outcome"] == "aborted"


def test_a_bad_parameter_ends_the_process_with_its_name(processes: Processes) -> None:
    node = processes.start("reference", {"chunk_stesp": 3})
    assert node.wait() == REFUSED
    assert "chunk_steps" in node.output.splitlines()[-1]


def test_a_node_that_waits_names_the_namespaces_in_which_others_are(processes: Processes) -> None:
    processes.start("reference", overrides(), namespace="/elsewhere")
    controller = processes.start("controller", overrides())
    controller.wait_for_output("/elsewhere")
