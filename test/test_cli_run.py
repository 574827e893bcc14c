"""``skydiver-utc run`` with real nodes, and the parts around them."""

import importlib.util
import json
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from child_processes import children

from skydiver_utc.analysis.recorded_flight import read_flight
from skydiver_utc.discovery import PROFILE, RANGE
from skydiver_utc.parameters import ParameterError, load_scenario, to_yaml
from skydiver_utc.recording.metadata import message_count, metadata_yaml
from skydiver_utc.simulation.closed_loop import simulate
from skydiver_utc.verbs.divers import divers, new_run_folder
from skydiver_utc.verbs.errors import VerbError
from skydiver_utc.verbs.node_processes import NODE_CODE, PACKAGE_FOLDER
from skydiver_utc.verbs.ros_environment import free_domain, node_environment
from skydiver_utc.verbs.run import _whereabouts

pytest_plugins = ("ros_domains",)

needs_ros = pytest.mark.skipif(importlib.util.find_spec("rclpy") is None, reason="needs rclpy")


def on(domain: int) -> dict[str, str]:
    """An environment with a domain that no other test has: `run` by itself would only see which ports are taken."""
    return {**os.environ, "ROS_DOMAIN_ID": str(domain)}


def start(folder: Path, domain: int, *options: str, **environment: str) -> "subprocess.Popen[str]":
    command = [
        sys.executable,
        "-m",
        "skydiver_utc.cli",
        "run",
        "slow_turn_pose_only",
        "--folder",
        str(folder),
    ]
    return subprocess.Popen(
        [*command, *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**on(domain), **environment},
    )


@needs_ros
def test_a_flight_over_ros_is_the_simulated_one(tmp_path: Path, domain: int) -> None:
    folder = tmp_path / "bags" / "flight"
    process = start(folder, domain, "--set", "duration_s=1", "--json")
    stdout, stderr = process.communicate(timeout=120)
    assert process.returncode == 0, stderr
    assert json.loads(stdout)["outcome"] == "completed"
    assert (folder / "metrics.json").read_text(encoding="utf-8") == stdout
    assert (folder / "tracking.png").is_file()
    flight = read_flight(folder)
    again = simulate(flight.scenario)
    for name in ("states", "commands", "applied", "reference", "telemetry"):
        np.testing.assert_array_equal(getattr(flight, name), getattr(again, name))


@needs_ros
def test_several_skydivers_fly_side_by_side(tmp_path: Path, domain: int) -> None:
    """One command; a run of its own for each, which `analyse` and `replay --check` take like any other."""
    command = [
        *(sys.executable, "-m", "skydiver_utc.cli"),
        "run",
        "anna=slow_turn_pose_only",
        "turn_360_left",
    ]
    settings = ["--set", "duration_s=1", "--folder", str(tmp_path / "flight"), "--json"]
    finished = subprocess.run(
        [*command, *settings], env=on(domain), capture_output=True, text=True, timeout=300
    )
    assert finished.returncode == 0, finished.stderr
    told = json.loads(finished.stdout)
    assert list(told) == ["anna", "skydiver_2"]
    for name, values in told.items():
        folder = tmp_path / "flight" / name
        assert json.loads((folder / "metrics.json").read_text(encoding="utf-8")) == values
        flight = read_flight(folder)
        assert flight.states.tobytes() == simulate(flight.scenario).states.tobytes()
        check = [*(sys.executable, "-m", "skydiver_utc.cli"), "replay", str(folder), "--check"]
        assert subprocess.run(check, capture_output=True).returncode == 0


def test_skydivers_are_named_and_have_a_folder_each(tmp_path: Path) -> None:
    alone = divers(["slow_turn_pose_only"], [], tmp_path, None)
    assert [(diver.name, diver.folder.parent) for diver in alone] == [("skydiver", tmp_path)]
    both = divers(["slow_turn_pose_only", "b=turn_360_left"], [], tmp_path, tmp_path / "run")
    assert [(d.name, d.scenario.name, d.folder) for d in both] == [
        ("skydiver", "slow_turn_pose_only", tmp_path / "run" / "skydiver"),
        ("b", "turn_360_left", tmp_path / "run" / "b"),
    ]


def test_skydivers_that_cannot_fly_together_are_refused(tmp_path: Path) -> None:
    with pytest.raises(VerbError, match="two skydivers are called a"):
        divers(["a=turn_360_left", "a=turn_360_right"], [], tmp_path, None)
    slower = tmp_path / "slower.yaml"
    slower.write_text(to_yaml(load_scenario("turn_360_left", {"dt_s": 0.005})), encoding="utf-8")
    with pytest.raises(VerbError, match=r"cannot fly under one clock, dt_s is 0\.0042 and 0\.005"):
        divers(["turn_360_left", str(slower)], [], tmp_path, None)
    assert divers(["turn_360_left", str(slower)], ["dt_s=0.005"], tmp_path, None)


def test_nodes_do_not_come_from_the_current_folder(tmp_path: Path) -> None:
    """A file there that is named like a library, or like this package, is not what runs."""
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


@needs_ros
def test_ctrl_c_leaves_a_recording_that_can_be_analysed(tmp_path: Path, domain: int) -> None:
    folder = tmp_path / "flight"
    process = start(folder, domain, "--set", "duration_s=600")
    recording = folder / "flight_0.mcap"
    deadline = time.monotonic() + 60
    while not recording.is_file() and time.monotonic() < deadline:
        time.sleep(0.1)
    time.sleep(1.0)
    process.send_signal(signal.SIGINT)
    _, stderr = process.communicate(timeout=60)
    assert process.returncode == 130
    told = f"the recording so far is in {folder}" if message_count(folder) else "nothing was recorded yet"
    assert f"stopped: {told}" in stderr
    assert "Traceback" not in stderr


@needs_ros
def test_a_node_that_fails_is_named(tmp_path: Path, domain: int) -> None:
    process = start(tmp_path / "flight", domain, RMW_IMPLEMENTATION="rmw_of_nobody")
    stdout, stderr = process.communicate(timeout=120)
    assert (process.returncode, stdout) == (1, "")
    assert " node failed (" in stderr
    assert "rmw_of_nobody" in stderr


@needs_ros
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs /proc")
def test_of_two_skydivers_the_one_whose_node_fails_is_named_and_both_recordings(
    tmp_path: Path, domain: int
) -> None:
    process = subprocess.Popen(
        [
            *(sys.executable, "-m", "skydiver_utc.cli", "run", "a=turn_360_left", "b=turn_360_left"),
            *("--folder", str(tmp_path / "run"), "--set", "duration_s=600", "--quiet"),
        ],
        env=on(domain),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    files = [tmp_path / "run" / name / f"{name}_0.mcap" for name in "ab"]
    deadline = time.monotonic() + 120
    while not all(file.is_file() and file.stat().st_size > 50_000 for file in files):
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.05)
    (controller,) = (
        pid
        for pid, command in children(process.pid)
        if "controller_node" in command and "__ns:=/b" in command
    )
    os.kill(controller, signal.SIGKILL)
    _, stderr = process.communicate(timeout=120)
    assert process.returncode == 1
    assert "the controller node of b failed (signal SIGKILL), the recording so far is in" in stderr
    for name in "ab":
        assert f"`skydiver-utc analyse {tmp_path / 'run' / name}`" in stderr
    assert "; of a: the recording so far is in" in stderr


def test_a_recording_without_messages_is_not_offered_for_analysis(tmp_path: Path) -> None:
    (tmp_path / "metadata.yaml").write_text(metadata_yaml("flight_0.mcap", [], None))
    assert _whereabouts(tmp_path) == f"nothing was recorded yet, {tmp_path} can be deleted"
    assert _whereabouts(tmp_path / "nowhere") == "nothing was recorded"


def test_run_folders_of_one_second_do_not_meet(tmp_path: Path) -> None:
    folders = [new_run_folder(tmp_path, "synthetic") for _ in range(2)]
    assert all(folder.name.endswith("Z_synthetic") for folder in folders)
    folders[1].mkdir()
    assert new_run_folder(tmp_path, "synthetic") != folders[1]


def test_nodes_stay_on_this_machine_and_in_a_domain_of_their_own() -> None:
    environment = node_environment({"PATH": "/bin"})
    assert environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
    assert 1 <= int(environment["ROS_DOMAIN_ID"]) <= 101


def test_what_the_caller_has_set_stands() -> None:
    given = {
        "ROS_DOMAIN_ID": "7",
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
        "LD_LIBRARY_PATH": "/opt/ros/lib",
    }
    environment = node_environment(given)
    assert {name: environment[name] for name in given} == given


@pytest.mark.parametrize("domain", ["900", "233", "abc", "-1", "1.5", "²"])
def test_a_domain_that_there_is_not_is_named_with_those_that_there_are(domain: str) -> None:
    with pytest.raises(VerbError) as raised:
        node_environment({"ROS_DOMAIN_ID": domain})
    assert str(raised.value) == f"ROS_DOMAIN_ID is {domain!r}: it must be a whole number from 0 to 232"
    assert node_environment({"ROS_DOMAIN_ID": "232"})["ROS_DOMAIN_ID"] == "232"


@pytest.mark.parametrize("given", [{}, {RANGE: "SUBNET"}], ids=["this machine", "a network"])
def test_nodes_get_the_profile_that_repairs_losses_soon(given: dict[str, str]) -> None:
    profile = Path(node_environment(given)[PROFILE])
    assert "heartbeatPeriod" in profile.read_text(encoding="utf-8")
    own = {**given, PROFILE: "/mine.xml"}
    assert node_environment(own)[PROFILE] == "/mine.xml"


def test_a_discovery_range_that_ros_does_not_know_is_refused() -> None:
    with pytest.raises(ParameterError, match="must be one of LOCALHOST, SUBNET"):
        node_environment({RANGE: "subnet"})


def test_the_libraries_of_another_environment_are_not_handed_on() -> None:
    given = {
        "ROS_DOMAIN_ID": "7",
        "_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1",
        "LD_LIBRARY_PATH": "/a/site-packages/ros_rcl.libs:/mine",
    }
    environment = node_environment(given)
    assert environment["LD_LIBRARY_PATH"] == "/mine"
    assert "_ROS_WHEELS_BOOTSTRAP_COMPLETE" not in environment


def test_a_domain_in_use_is_not_free(monkeypatch: pytest.MonkeyPatch, domain: int) -> None:
    monkeypatch.setattr("skydiver_utc.verbs.ros_environment._DOMAINS", [domain])
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as node:
        node.bind(("", 7410 + 250 * domain))
        with pytest.raises(Exception, match="no free ROS domain"):
            free_domain()
    assert free_domain() == domain
