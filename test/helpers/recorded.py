# SPDX-License-Identifier: Apache-2.0
"""What a run folder holds, by topic and step, read by the mcap library and rclpy."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message
from ros_fixtures import Ros

from bags import stored
from skydiver_utc.analysis.recorded_run import read_run
from skydiver_utc.loop.build import build_plant
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.messages import StepGrid, read_named, read_outcome, read_state, run_id_of
from skydiver_utc.nodes import topics
from skydiver_utc.nodes.topics import Topic
from skydiver_utc.parameters import load_scenario


class Bag:
    """A recorded run in a namespace."""

    def __init__(self, folder: Path, namespace: str = "/skydiver") -> None:
        self.scenario = load_scenario(str(folder / "scenario.yaml"))
        self.plant = build_plant(self.scenario)
        self.grid = StepGrid(self.scenario.stamp_ns(0), self.scenario.dt_ns)
        self.folder, self._namespace = folder, namespace
        assert (folder / "metadata.yaml").is_file()

    def of(self, topic: Topic) -> list[Any]:
        """The messages of a topic."""
        name = topic.name if topic.name.startswith("/") else f"{self._namespace}/{topic.name}"
        of_state = topic in (topics.STATE, topics.ESTIMATE)
        kind = topics.STATE_TYPES[self.plant.state_message] if of_state else topic.type
        return [deserialize_message(m.cdr, kind) for m in stored(self.folder) if m.topic == name]

    def steps(self, topic: Topic) -> list[int]:
        """The step of each message."""
        stamps = [m.clock if topic is topics.CLOCK else m.header.stamp for m in self.of(topic)]
        return [self.grid.step_of(stamp) for stamp in stamps]

    def states(self) -> NDArray[np.float64]:
        """Recorded states (n, states)."""
        return np.array([read_state(message, self.plant.state_names) for message in self.of(topics.STATE)])

    def named(self, topic: Topic, names: tuple[str, ...] = ()) -> NDArray[np.float64]:
        """Recorded values (n, v) by name, of controls unless other names are given."""
        return np.array(
            [read_named(message, names or self.plant.control_names) for message in self.of(topic)]
        )

    def outcome(self) -> dict[str, Any]:
        """The one outcome."""
        (message,) = self.of(topics.OUTCOME)
        return read_outcome(message.data)


def fly(ros: Ros, folder: Path, given: dict[str, Any], *kinds: str) -> Bag:
    """A recorded run of reference, controller, plant and other nodes: complete and equal to the simulation."""
    recorder = ros.node("recorder", given | {"out": str(folder)})
    nodes = ros.start(given | {"wait_for_recorder": True}, "reference", *kinds, "controller", "plant")
    ros.spin_until(lambda: recorder.finished and not recorder.not_in_bag())
    assert {node.close() for node in (*nodes, recorder)} == {0}
    bag = Bag(folder)
    assert_equals_simulation(bag)
    assert bag.outcome()["run_id"] == nodes[-1].run_id == run_id_of(bag.of(topics.SCENARIO)[0].data)
    return bag


def assert_complete(bag: Bag) -> None:
    """Every step of every topic that has one a step, once and in order."""
    states = list(range(bag.scenario.steps + 1))
    for topic in topics.RECORDED:
        optional = topic in (topics.DISTURBANCE, topics.ESTIMATE, topics.ESTIMATOR_TELEMETRY)
        if topic.fewer_than_states is not None and (not optional or bag.of(topic)):
            assert bag.steps(topic) == states[: len(states) - topic.fewer_than_states], topic.name
    assert len(bag.of(topics.SCENARIO)) == 1


def assert_equals_simulation(bag: Bag) -> None:
    """The run is complete and the simulated one, bit for bit."""
    assert_complete(bag)
    run, outcome = simulate(bag.scenario), bag.outcome()
    assert (outcome["outcome"], outcome["states"]) == (run.outcome.value, len(run.states))
    assert bag.states().tobytes() == run.states.tobytes()
    assert bag.named(topics.COMMAND).tobytes() == run.commands.tobytes()
    assert bag.named(topics.APPLIED_COMMAND).tobytes() == run.applied.tobytes()
    assert bag.named(topics.SETPOINT, run.tracked_names).tobytes() == run.reference.tobytes()
    if run.disturbance_names:
        assert bag.named(topics.DISTURBANCE, run.disturbance_names).tobytes() == run.disturbance.tobytes()
    assert read_run(bag.folder).telemetry.tobytes() == run.telemetry.tobytes()
