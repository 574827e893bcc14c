# SPDX-License-Identifier: Apache-2.0
"""What `skydiver-utc run` decides before it starts a node: names, folders, and the environment of the nodes."""

import json
from contextlib import ExitStack
from datetime import datetime, tzinfo
from pathlib import Path
from typing import Any

import pytest
from command_line import invoke
from own_slots import cart_file
from recordings import write_run
from refusals import assert_refused
from runs import CART, random_run

from skydiver_utc.cli.errors import CommandError
from skydiver_utc.cli.planned_runs import planned_runs
from skydiver_utc.cli.ros_environment import free_domain, node_environment
from skydiver_utc.errors import InputError
from skydiver_utc.nodes.discovery import PROFILE, RANGE
from skydiver_utc.parameters import load_scenario, run_folder
from skydiver_utc.parameters.run_folder import new_run_folder


def test_runs_are_named_and_have_a_folder_each(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (alone,) = planned_runs(["slow_turn_pose_only"], [], None)
    assert (alone.name, alone.folder.parent, alone.module_folder) == ("skydiver", Path("bags"), None)
    both = planned_runs(["slow_turn_pose_only", f"b={cart_file(tmp_path)}"], [], tmp_path / "run")
    assert [(run.name, run.scenario.name, run.folder, run.module_folder) for run in both] == [
        ("skydiver", "slow_turn_pose_only", tmp_path / "run" / "skydiver", None),
        ("b", "cart", tmp_path / "run" / "b", tmp_path),
    ]


class NodesThatFly(ExitStack):
    """In the place of the nodes of a run: the recorder leaves a recording, the plant reports an outcome."""

    def __init__(self, environment: Any, log_folder: Path, name: str, *_: object) -> None:
        super().__init__()
        self._name = name
        self.failed = lambda *_: None
        self.ended = lambda _: True
        self.end = lambda: None
        self.reports = lambda: [{"outcome": "completed"}]

    def start(self, kind: str, parameters: dict[str, Any]) -> None:
        if kind == "recorder":
            run = random_run(load_scenario(parameters["scenario"]), steps=5)
            write_run(Path(parameters["out"]), run, namespaces=(f"/{self._name}",), run_id=self._name)


@pytest.mark.usefixtures("unrendered")
def test_of_several_runs_one_object_has_the_metrics_by_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("skydiver_utc.cli.run.NodeProcesses", NodesThatFly)
    cart, folder = tmp_path / "cart.yaml", tmp_path / "run"
    cart.write_text(CART, encoding="utf-8")
    result = invoke("run", f"anna={cart}", cart, "--out", folder, "--json", "--quiet")
    assert result.exit_code == 0, result.output
    values = json.loads(result.stdout)
    assert list(values) == ["anna", "skydiver_2"]
    for name, metrics in values.items():
        assert metrics["run_id"] == name
        assert json.loads((folder / name / "metrics.json").read_text(encoding="utf-8")) == metrics


def test_two_runs_of_one_name_and_a_folder_that_exists_are_refused(tmp_path: Path) -> None:
    with pytest.raises(CommandError, match="called a"):
        planned_runs(["a=turn_360_left", "a=turn_360_right"], [], tmp_path / "run")
    with pytest.raises(CommandError, match="an-na"):
        planned_runs(["an-na=turn_360_left"], [], tmp_path / "run")
    with pytest.raises(CommandError, match=str(tmp_path)):
        planned_runs(["turn_360_left"], [], tmp_path)


def test_run_folders_of_one_second_have_different_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Stopped(datetime):
        @classmethod
        def now(cls, tz: tzinfo | None = None) -> datetime:
            return datetime(2026, 1, 2, 3, 4, 5, tzinfo=tz)

    monkeypatch.setattr(run_folder, "datetime", Stopped)
    made = [new_run_folder(tmp_path / "some" / "bags", "a b") for _ in range(3)]
    assert [folder.name for folder in made] == [
        f"20260102T030405Z_a_b{number}" for number in ("", "_2", "_3")
    ]
    assert all(folder.is_dir() for folder in made)


def test_nodes_stay_on_this_machine_and_on_a_free_domain_below_the_ephemeral_ports() -> None:
    environment = node_environment({"PATH": "/bin"})
    assert environment[RANGE] == "LOCALHOST"
    assert int(environment["ROS_DOMAIN_ID"]) in range(1, 102)
    assert free_domain() in range(1, 102)
    assert "heartbeatPeriod" in Path(environment[PROFILE]).read_text(encoding="utf-8")


def test_the_callers_environment_is_kept() -> None:
    given = {"ROS_DOMAIN_ID": "232", RANGE: "SUBNET", PROFILE: "/mine.xml"}
    assert given.items() <= node_environment(given).items()


@pytest.mark.parametrize(
    ("variable", "value"),
    [*(("ROS_DOMAIN_ID", domain) for domain in ("900", "233", "abc", "-1", "1.5", "²")), (RANGE, "subnet")],
)
def test_what_ros_does_not_know_is_named(variable: str, value: str) -> None:
    words = (repr(value), {"ROS_DOMAIN_ID": "232", RANGE: "SUBNET"}[variable])
    assert_refused(words, node_environment, {variable: value}, kind=InputError)
