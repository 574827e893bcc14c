# SPDX-License-Identifier: Apache-2.0
"""Nodes as processes: a second one of a kind, and each one killed and started again during a run."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import own_slots
import pytest
from child_processes import wait_until
from own_slots import cart_file
from ros_fixtures import JOINT_STATE, Processes, Ros, overrides

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
        self.spectator = ros.partner("spectator")
        received = {
            topic: self.spectator.receive(JOINT_STATE if topic is topics.STATE else topic)
            for topic in topics.RECORDED
        }
        self.spectator.publisher(topics.RECORDER_READY).publish(topics.RECORDER_READY.type(data="here"))
        self.states, self.commands = received[topics.STATE], received[topics.COMMAND]
        self.changes, self.outcomes = received[topics.CHANGES], received[topics.OUTCOME]
        self.nodes: dict[str, Any] = {}

    def start(self, *kinds: str, **settings: object) -> None:
        for kind in kinds:
            # They begin when the spectator is matched, so that it misses no message.
            self.nodes[kind] = self._processes.start(
                kind, self.given | {"wait_for_recorder": True} | settings
            )

    def refuse_second(self, kind: str, topic: str) -> None:
        """A second node of a kind exits with one sentence that names what the first one publishes."""
        self.ros.spin_until(lambda: self.spectator.count_publishers(f"/skydiver/{topic}"))
        second = self._processes.start(kind, self.given)
        self.ros.spin_until(lambda: second.ended)
        assert second.wait() == REFUSED
        last = second.output.splitlines()[-1]
        assert last.startswith(f"{kind}_node: ")
        assert f"/skydiver/{topic}" in last
        assert not self.nodes[kind].ended

    def outcome(self) -> dict[str, Any]:
        """The outcome of a run that began; a second plant, which is refused, publishes one, too."""

        def found() -> list[dict[str, Any]]:
            return [one for one in (read_outcome(m.data) for m in self.outcomes) if one["states"]]

        self.ros.spin_until(found)
        return found()[-1]

    def step_of(self, message: Any) -> int:
        since_ns = (message.header.stamp.sec - 1_767_225_600) * 10**9 + message.header.stamp.nanosec
        return int(since_ns // 10_000_000)

    def reached(self) -> int:
        return self.step_of(self.states[-1])

    def by_step(self, states: list[Any]) -> dict[int, Any]:
        return {self.step_of(m): read_named(m, ("position", "speed")) for m in states}


def test_second_nodes_are_refused_and_killed_ones_started_again_continue_or_begin_a_new_run(
    ros: Ros, processes: Processes, tmp_path: Path
) -> None:
    stage = Stage(ros, processes, tmp_path)
    stage.start("reference")
    stage.start("plant", command_timeout_s=0.3, command_retries=200)
    stage.refuse_second("plant", "state")
    stage.refuse_second("reference", "reference")
    stage.start("controller")
    stage.ros.spin_until(lambda: len(stage.states) > 50)
    stage.nodes["reference"].kill()
    stage.start("reference")
    killed_at = stage.reached()
    # More than what it had published ahead.
    stage.ros.spin_until(lambda: stage.reached() > killed_at + 200)
    stage.nodes["plant"].kill()
    first = list(stage.states)
    stage.start("plant", command_timeout_s=0.3, command_retries=200)
    # The last states of the first plant may still be on their way.
    stage.ros.spin_until(lambda: any(stage.step_of(m) == 0 for m in stage.states[len(first) :]))
    stage.ros.spin_until(lambda: stage.reached() > 50)
    stage.nodes["controller"].kill()
    stage.start("controller")
    found = stage.outcome()
    assert (found["outcome"], found["states"]) == ("completed", 2001)
    assert stage.nodes["plant"].wait() == 0
    stage.ros.spin_until(lambda: stage.reached() == 2000)
    stage.refuse_second("controller", "command")

    flown = simulate(load_scenario(stage.given["scenario"], {"duration_s": 20.0})).states
    assert_flown(stage.by_step(first), flown)
    # The controller that was started again begins from the newest applied command.
    change = json.loads(stage.changes[0].data)
    steps = [stage.step_of(m) for m in stage.states]
    begins = len(steps) - 1 - steps[::-1].index(0)  # a busy machine may have had a state retransmitted since
    second = stage.by_step(stage.states[begins:])
    assert sorted(second) == list(range(2001))
    assert_flown({k: state for k, state in second.items() if k <= change["step"]}, flown)
    names = ("force", "brake")
    held = {stage.step_of(m): read_named(m, names) for m in stage.commands}[change["step"] - 1]
    np.testing.assert_allclose(change["control"], held, rtol=1e-12)


def assert_flown(by_step: dict[int, Any], flown: Any) -> None:
    """The states of these steps are the simulated ones, bit for bit."""
    assert len(by_step) > 50
    assert np.array(list(by_step.values())).tobytes() == flown[list(by_step)].tobytes()


def test_a_node_that_waits_names_the_namespaces_in_which_others_are(processes: Processes) -> None:
    processes.start("reference", overrides(), "-r", "__ns:=/elsewhere")
    controller = processes.start("controller", overrides())
    wait_until(lambda: "/elsewhere" in controller.output)
