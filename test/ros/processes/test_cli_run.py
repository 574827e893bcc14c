# SPDX-License-Identifier: Apache-2.0
"""``skydiver-utc run`` with real nodes, and its parts."""

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import own_slots
import pytest
from child_processes import PATIENCE_S, children, wait_for_end, wait_until
from command_line import call, invoke, start
from own_slots import CART, cart_file
from recorded import Bag

from skydiver_utc.cli.node_processes import NODE_CODE, PACKAGE_FOLDER
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.nodes import topics
from skydiver_utc.recording.metadata import message_count
from skydiver_utc.recording.recovery import recover

pytest_plugins = ("ros_domains",)
pytestmark = pytest.mark.processes


class Command:
    """Runs `skydiver-utc` in a process, on a domain of its own."""

    def __init__(self, domain: int, folder: Path) -> None:
        self.domain, self.folder = domain, folder
        (folder / "scenarios").mkdir()
        # The module of the cart is found beside its scenario file only.
        shutil.copy(own_slots.__file__, folder / "scenarios")
        self.cart = cart_file(folder / "scenarios")

    def start(self, *arguments: str) -> "subprocess.Popen[str]":
        return start(*arguments, ROS_DOMAIN_ID=self.domain)

    def start_long_run(self, *scenarios: str, folder: Path) -> "subprocess.Popen[str]":
        """A run of ten minutes, once each of its recordings has messages."""
        process = self.start("run", *scenarios, "--out", str(folder), "--set", "duration_s=600")
        names = [scenario.partition("=")[0] for scenario in scenarios] if len(scenarios) > 1 else [""]
        files = [folder / name / f"{name or folder.name}_0.mcap" for name in names]
        wait_until(lambda: all(f.is_file() and f.stat().st_size > 20_000 for f in files), process)
        return process

    def node_of(self, process: "subprocess.Popen[str]", kind: str, namespace: str = "") -> int:
        """The process id of a node."""
        (pid,) = (
            pid
            for pid, command in children(process.pid)
            if f"{kind}_node" in command and f"__ns:=/{namespace}" in command
        )
        return pid


@pytest.fixture
def command(domain: int, tmp_path: Path) -> Command:
    return Command(domain, tmp_path)


def test_ctrl_c_leaves_a_recording_that_can_be_analysed(command: Command, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    process = command.start_long_run(command.cart, folder=folder)
    process.send_signal(signal.SIGINT)
    _, stderr = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130
    assert message_count(folder) > 100
    assert f"skydiver-utc analyse {folder}" in stderr
    assert "Traceback" not in stderr
    bag = Bag(folder)
    assert bag.outcome()["outcome"] == "aborted"
    steps = bag.steps(topics.STATE)
    assert len(steps) >= 20
    assert steps == list(range(len(steps)))
    assert invoke("analyse", folder).exit_code == 0


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs /proc")
def test_nodes_end_with_a_run_that_is_killed(command: Command, tmp_path: Path) -> None:
    process = command.start_long_run(command.cart, folder=tmp_path / "run")
    nodes = [pid for pid, _ in children(process.pid)]
    assert len(nodes) == 4
    process.kill()
    process.communicate()
    wait_for_end(nodes)
    assert (tmp_path / "run" / "metadata.yaml").is_file()


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs /proc")
def test_of_two_runs_each_has_its_namespace_clock_and_folder_and_a_failure_names_its_node_and_both(
    command: Command, tmp_path: Path
) -> None:
    folder, other = tmp_path / "run", tmp_path / "scenarios" / "slower.yaml"
    other.write_text(CART.replace("dt_s: 0.01", "dt_s: 0.02"), encoding="utf-8")
    process = command.start_long_run(f"a={command.cart}", f"b={other}", folder=folder)
    os.kill(command.node_of(process, "controller", "b"), signal.SIGKILL)
    _, stderr = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 1
    for word in ("controller", " b ", "SIGKILL", str(folder / "a"), str(folder / "b")):
        assert word in stderr, word
    for name in ("a", "b"):
        bag = Bag(folder / name, f"/{name}")
        states = bag.states()
        assert states.tobytes() == simulate(bag.scenario).states[: len(states)].tobytes()
        listed = (folder / name / "metadata.yaml").read_text()
        assert f"name: /{name}/clock" in listed
        assert "name: /clock" not in listed


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs /proc")
def test_a_run_whose_recorder_is_killed_reaches_its_end(command: Command, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    process = command.start("run", command.cart, "--out", str(folder), "--set", "duration_s=15")
    file = folder / "run_0.mcap"
    wait_until(lambda: file.is_file() and file.stat().st_size > 60_000, process)
    os.kill(command.node_of(process, "recorder"), signal.SIGKILL)
    _, stderr = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 1
    for word in ("recorder", "SIGKILL", f"skydiver-utc recover {folder}"):
        assert word in stderr, word
    assert recover(folder, tmp_path / "recovered").counts["/skydiver/state"] > 50


def test_a_node_that_fails_is_named_with_its_reason(command: Command, tmp_path: Path) -> None:
    code, stdout, stderr = call(
        "run", command.cart, "--out", tmp_path / "run",
        ROS_DOMAIN_ID=command.domain, RMW_IMPLEMENTATION="rmw_of_nobody",
    )  # fmt: skip
    assert (code, stdout) == (1, "")
    assert "node of skydiver failed" in stderr
    assert "rmw_of_nobody" in stderr


def test_nodes_do_not_import_from_the_current_folder(tmp_path: Path) -> None:
    """Neither a file named like a library, nor one named like this package."""
    (tmp_path / "yaml.py").write_text("raise RuntimeError('from the current folder')")
    (tmp_path / "skydiver_utc").mkdir()
    (tmp_path / "skydiver_utc" / "__init__.py").write_text("raise RuntimeError('from the current folder')")
    finished = subprocess.run(
        [sys.executable, "-c", NODE_CODE.format(kind="plant"), "--help"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": PACKAGE_FOLDER},
        capture_output=True,
        text=True,
    )
    assert finished.returncode == 0, finished.stderr
    assert "scenario" in finished.stdout
