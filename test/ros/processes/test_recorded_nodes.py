# SPDX-License-Identifier: Apache-2.0
"""Recorded runs with nodes as processes: complete, equal to the simulation, also when the recorder is disturbed."""

import os
import shutil
import signal
import time
from pathlib import Path

import numpy as np
import own_slots
import pytest
from layouts import assert_layouts_fit
from own_slots import cart_file
from recorded import Bag, assert_complete, assert_equals_simulation
from ros_fixtures import NodeProcess, Processes, Ros, overrides

from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.loop.outcome import Outcome
from skydiver_utc.nodes import topics
from skydiver_utc.recording.recovery import recover

pytest_plugins = ("ros_fixtures",)
pytestmark = pytest.mark.processes

# `SKYDIVER_UTC_KILLS=20`, which is `make kills`: so many kills, each loss printed and held to half a second.
KILLS = int(os.environ.get("SKYDIVER_UTC_KILLS", "1"))
LARGEST_LOSS_S = 0.5 if "SKYDIVER_UTC_KILLS" in os.environ else float("inf")


def test_four_processes_equal_the_simulation(processes: Processes, tmp_path: Path) -> None:
    folder, given = tmp_path / "bag", overrides(1.0)
    waiting = given | {"wait_for_recorder": True}
    recorder = processes.start("recorder", given | {"out": folder})
    servers = [processes.start("controller", waiting), processes.start("reference", waiting)]
    plant = processes.start("plant", waiting | {"progress": True})
    assert plant.wait() == 0, plant.output
    assert recorder.wait() == 0, recorder.output
    for server, number in zip(servers, (signal.SIGINT, signal.SIGTERM), strict=True):
        server.signal(number)
        assert server.wait() == 0, server.output
    reports = plant.reports()
    assert reports[0].items() >= {"step": 119, "steps": 239}.items()
    assert reports[-1]["outcome"] == "completed"
    bag = Bag(folder)
    assert_equals_simulation(bag)
    assert_layouts_fit(folder)


class Recorded:
    """A recorder process, and the nodes of a cart in this process."""

    def __init__(self, ros: Ros, processes: Processes, folder: Path, duration_s: float) -> None:
        shutil.copy(own_slots.__file__, folder)
        self.ros, self._processes = ros, processes
        self.given: dict[str, object] = {"scenario": cart_file(folder), "duration_s": duration_s}
        self.folder = folder / "run"
        self.recorder = self.start_recorder(self.folder)
        waiting = self.given | {"wait_for_recorder": True}
        *_, self.plant = ros.start(waiting, "reference", "controller", "plant")

    def start_recorder(self, folder: Path) -> NodeProcess:
        return self._processes.start("recorder", self.given | {"out": folder})

    def until_step(self, k: int) -> None:
        self.ros.spin_until(lambda: self.plant.k >= k)

    def until_recorded(self) -> Bag:
        self.ros.spin_until(lambda: self.recorder.ended)
        assert self.recorder.wait() == 0, self.recorder.output
        assert "Traceback" not in self.recorder.output
        return Bag(self.folder)


@pytest.mark.parametrize(
    ("duration_s", "signals", "complete"),
    [
        (0.5, (signal.SIGTERM, signal.SIGINT), True),
        (600.0, (signal.SIGTERM, signal.SIGINT), False),
        (600.0, (signal.SIGINT,), False),
    ],
)
def test_a_recorder_interrupted_at_the_end_of_the_run_leaves_a_complete_bag_and_during_it_a_readable_one(
    ros: Ros,
    processes: Processes,
    tmp_path: Path,
    duration_s: float,
    signals: tuple[signal.Signals, ...],
    complete: bool,
) -> None:
    run = Recorded(ros, processes, tmp_path, duration_s)
    ros.spin_until(lambda: run.plant.finished or run.plant.k > 100)
    assert run.plant.finished is complete
    for number in signals:
        run.recorder.signal(number)
    bag = run.until_recorded()
    steps = bag.steps(topics.STATE)
    assert steps == list(range(len(steps)))
    assert len(steps) > 50
    if complete:
        assert_complete(bag)


def test_a_recorder_that_stands_still_misses_nothing(ros: Ros, processes: Processes, tmp_path: Path) -> None:
    """With the usual depth of 10 at the publishers, hundreds of steps would be missing.

    It stands still for less than the 20 s after which DDS gives a silent process up, on a busy machine, too.
    """
    run = Recorded(ros, processes, tmp_path, 10.0)
    run.until_step(50)
    run.recorder.signal(signal.SIGSTOP)
    run.until_step(350)
    run.recorder.signal(signal.SIGCONT)
    bag = run.until_recorded()
    assert_equals_simulation(bag)


def test_a_run_continues_when_its_recorder_is_killed_and_another_one_records_the_rest(
    ros: Ros, processes: Processes, tmp_path: Path
) -> None:
    """The rest is longer than the history of a publisher for a subscriber that does not acknowledge."""
    run = Recorded(ros, processes, tmp_path, 600.0)
    run.until_step(50)
    run.recorder.kill()
    run.until_step(50 + topics.EACH_STEP.depth)
    run.recorder, run.folder = run.start_recorder(tmp_path / "second"), tmp_path / "second"
    ros.spin_until(lambda: list(run.folder.glob("*.mcap")) and "ready" in run.recorder.output)
    ready_at = run.plant.k
    run.until_step(ready_at + 1000)
    assert run.plant.close() == 0
    bag = run.until_recorded()
    assert bag.outcome()["outcome"] == run.plant.run.outcome.value == Outcome.ABORTED.value
    last = bag.outcome()["states"] - 1
    for topic in topics.RECORDED:
        if topic.needed and topic.fewer_than_states is not None:
            steps = bag.steps(topic)
            assert steps == list(range(steps[0], steps[-1] + 1)), topic.name
            # State ready_at may have been sent before the recorder was ready, the next one was not.
            assert 0 < steps[0] <= ready_at + 1, topic.name
            # The controller may have answered the last state, too, before the end reached it.
            assert steps[-1] - (last - topic.fewer_than_states) in (0, 1), topic.name
    assert len(bag.of(topics.SCENARIO)) == 1
    first = bag.steps(topics.STATE)[0]
    assert bag.states().tobytes() == simulate(bag.scenario).states[first : last + 1].tobytes()


@pytest.mark.parametrize("seed", range(KILLS))
def test_a_killed_recorder_leaves_all_but_the_last_moments(
    ros: Ros, processes: Processes, tmp_path: Path, capsys: pytest.CaptureFixture[str], seed: int
) -> None:
    wait_s = float(np.random.default_rng(seed).uniform(0.0, 3.0))
    run = Recorded(ros, processes, tmp_path, 600.0)
    sent_at_s: dict[int, float] = {}

    def note(condition: bool) -> bool:
        sent_at_s.setdefault(run.plant.k, time.monotonic())
        return condition

    file = run.folder / "run_0.mcap"
    ros.spin_until(lambda: note(run.plant.k > 10 and file.stat().st_size > 10_000))
    kill_at_s = time.monotonic() + wait_s
    ros.spin_until(lambda: note(time.monotonic() >= kill_at_s))
    run.recorder.signal(signal.SIGKILL)
    killed_at_s, sent = time.monotonic(), run.plant.k + 1
    assert run.recorder.wait() == -signal.SIGKILL
    run.until_step(sent + 100)
    assert not run.plant.finished

    found = recover(run.folder, tmp_path / "recovered")
    assert found.lost_messages is None
    shutil.copy(run.folder / "scenario.yaml", tmp_path / "recovered")
    bag = Bag(tmp_path / "recovered")
    count = len(bag.of(topics.STATE))
    assert bag.steps(topics.STATE) == list(range(count))
    assert 0 < count <= sent
    assert bag.states().tobytes() == simulate(bag.scenario).states[:count].tobytes()
    # How long before the kill the first missing state was sent.
    missing = [at_s for step, at_s in sent_at_s.items() if step >= count]
    loss_s = killed_at_s - min(missing, default=killed_at_s)
    if LARGEST_LOSS_S < 1.0:
        with capsys.disabled():
            print(f"\nkill {seed}: {count} of {sent} states recovered, the last {loss_s:.3f} s lost")
    assert loss_s <= LARGEST_LOSS_S


def test_a_folder_that_exists_ends_the_recorder_with_one_sentence(
    processes: Processes, tmp_path: Path
) -> None:
    (tmp_path / "notes.txt").touch()
    recorder = processes.start("recorder", overrides(out=str(tmp_path)))
    assert recorder.wait() == 2
    last = recorder.output.strip().splitlines()[-1]
    assert last.startswith("recorder_node: ")
    assert str(tmp_path) in last
    assert "Traceback" not in recorder.output
