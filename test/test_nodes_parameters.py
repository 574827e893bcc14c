"""Parameters of the nodes: declared, overridden by name, and refused by name."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from rcl_interfaces.msg import ParameterType
from rclpy.parameter import Parameter
from ros_fixtures import SCENARIO, Processes, Ros, overrides

from skydiver_utc.nodes.node_parameters import OWN_PARAMETERS, resolve
from skydiver_utc.nodes.scenario_node import ScenarioNode
from skydiver_utc.parameters import ParameterError, leaves, load_scenario, to_yaml

pytest_plugins = ("ros_fixtures",)

KINDS = tuple(OWN_PARAMETERS)


def test_overrides_are_merged_into_the_scenario() -> None:
    resolved = resolve("controller", overrides(controller__horizon_steps=7, duration_s=3))
    assert resolved.scenario.controller.horizon_steps == 7
    assert resolved.scenario.duration_s == 3.0
    assert resolved.changes == (
        "duration_s = 3.0 (scenario file: 20.0)",
        "controller.horizon_steps = 7 (scenario file: 20)",
    )


def test_without_overrides_the_scenario_is_that_of_its_file() -> None:
    resolved = resolve("plant", {"scenario": SCENARIO})
    assert resolved.scenario == load_scenario(SCENARIO)
    assert resolved.changes == ()


def test_a_scenario_can_be_the_path_of_a_file(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(to_yaml(load_scenario(SCENARIO, {"duration_s": 2.0})), encoding="utf-8")
    assert resolve("plant", {"scenario": str(path)}).scenario.duration_s == 2.0


def test_an_int_will_do_for_a_float_everywhere() -> None:
    resolved = resolve("plant", overrides(command_timeout_s=3, reference__amplitude_deg_s=90))
    assert resolved.own["command_timeout_s"] == 3.0
    assert isinstance(resolved.own["command_timeout_s"], float)
    assert resolved.scenario.reference.amplitude_deg_s == 90.0


def test_what_rclpy_reads_itself_is_left_alone() -> None:
    given = {"use_sim_time": True, "qos_overrides./clock.publisher.depth": 3}
    assert resolve("plant", overrides() | given).changes


REFUSED: list[tuple[str, dict[str, Any], str]] = [
    ("plant", {"scenario": "fast_turn_unknown_dynamic"}, "fast_turn_unknown_dynamics"),
    ("plant", {"scenario": "no/such.yaml"}, "no/such.yaml"),
    ("plant", {"scenario": 3}, "parameter scenario must be of type str, found 3"),
    ("controller", {"controller.horizon_step": 3}, "controller.horizon_step"),
    ("controller", {"controller.horizon_steps": 0}, "controller.horizon_steps"),
    ("controller", {"controller.horizon_steps": 2.5}, "controller.horizon_steps"),
    ("controller", {"controller.P_err": float("nan")}, "controller.P_err"),
    ("controller", {"controller.coupling": "sometimes"}, "controller.coupling"),
    ("controller", {"duration_s": -1}, "duration_s"),
    ("controller", {"duration_s": "long"}, "duration_s"),
    ("controller", {"durations_s": 1.0}, "unknown parameter durations_s: did you mean duration_s"),
    ("controller", {"horizon": 1.0}, "unknown parameter horizon"),
    (
        "plant",
        {"comand_timeout_s": 1.0},
        "unknown parameter comand_timeout_s: did you mean command_timeout_s",
    ),
    ("plant", {"bag_folder": "x"}, "unknown parameter bag_folder"),
    ("plant", {"command_timeout_s": 0.0}, "parameter command_timeout_s must be at least 0.01, found 0.0"),
    ("plant", {"command_timeout_s": float("nan")}, "parameter command_timeout_s must be at least 0.01"),
    ("plant", {"command_timeout_s": float("inf")}, "parameter command_timeout_s must be"),
    ("plant", {"mode": "fast"}, "parameter mode must be one of lockstep, real_time, found fast"),
    ("controller", {"delay_steps": -1}, "parameter delay_steps must be at least 0, found -1"),
    ("plant", {"command_retries": -1}, "parameter command_retries must be at least 0, found -1"),
    ("plant", {"command_retries": True}, "parameter command_retries must be of type int, found True"),
    ("plant", {"progress": 1}, "parameter progress must be of type bool, found 1"),
    ("reference", {"chunk_steps": 0}, "parameter chunk_steps must be at least 1"),
    ("reference", {"chunk_steps": "all"}, "parameter chunk_steps must be of type int, found 'all'"),
    ("recorder", {"bag_folder": 5}, "parameter bag_folder must be of type str, found 5"),
]


@pytest.mark.parametrize(("kind", "given", "words"), REFUSED)
def test_a_bad_parameter_is_refused_by_name(kind: str, given: dict[str, Any], words: str) -> None:
    with pytest.raises(ParameterError) as caught:
        resolve(kind, overrides() | given)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


class Bare(ScenarioNode):
    """Only what all nodes share."""


def test_every_scalar_of_the_scenario_is_declared_with_its_range(ros: Ros) -> None:
    node = ros.add(Bare("controller", ros.context, overrides(controller__horizon_steps=7)))
    for leaf in leaves(node.scenario):
        value = node.get_parameter(leaf.name).value
        assert (list(value) if leaf.kind == "floats" else value) == (
            list(leaf.value) if isinstance(leaf.value, tuple) else leaf.value
        )
    horizon = node.describe_parameter("controller.horizon_steps")
    assert horizon.type == ParameterType.PARAMETER_INTEGER
    assert (horizon.integer_range[0].from_value, horizon.integer_range[0].to_value) == (1, 500)
    assert "[steps]" in horizon.description
    duration = node.describe_parameter("duration_s")
    assert duration.type == ParameterType.PARAMETER_DOUBLE
    assert duration.floating_point_range[0].to_value == 36000.0
    assert "yaw_acceleration" in node.describe_parameter("controller.coupling").additional_constraints


@pytest.mark.parametrize("name", ["duration_s", "subject.mass_kg", "scenario", "wait_for_recorder"])
def test_parameters_cannot_be_set_after_the_start(ros: Ros, name: str) -> None:
    node = ros.add(Bare("controller", ros.context, overrides()))
    before = node.get_parameter(name).value
    result = node.set_parameters([Parameter(name, value=before)])[0]
    assert not result.successful
    assert "read-only" in result.reason
    assert name in result.reason


def test_a_refused_node_leaves_nothing_behind(ros: Ros) -> None:
    partner = ros.partner()
    with pytest.raises(ParameterError):
        Bare("controller", ros.context, overrides(duration_s=-1))
    ros.spin_for(0.1)
    assert partner.get_node_names() == ["partner"]


@pytest.mark.parametrize("kind", KINDS)
def test_a_misspelt_parameter_ends_the_process_with_one_sentence(processes: Processes, kind: str) -> None:
    node = processes.start(kind, overrides(controller__horizon_step=3))
    assert node.wait() == 2
    assert node.output.strip().splitlines() == [
        f"{kind}_node: unknown parameter controller.horizon_step: did you mean horizon_steps"
        f" (scenario {SCENARIO})"
    ]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"duration_s": "-3.0"}, "duration_s"),
        ({"controller.W0": ".nan"}, "controller.W0"),
        ({"command_timeout_s": "[1, 2]"}, "command_timeout_s"),
        ({"duration_s": "[1, x]"}, "duration_s"),
    ],
)
def test_a_bad_value_ends_the_process_with_its_name(
    processes: Processes, given: dict[str, str], words: str
) -> None:
    node = processes.start("plant", overrides() | given)
    assert node.wait() == 2
    last = node.output.strip().splitlines()[-1]
    assert last.startswith("plant_node: ")
    assert words in last
    assert "Traceback" not in node.output


@pytest.mark.parametrize("argument", ["--duration", "fast_turn"])
def test_an_argument_that_is_no_parameter_is_refused(processes: Processes, argument: str) -> None:
    node = processes.start("plant", overrides(), argument)
    assert node.wait() == 2
    assert f"unknown argument {argument}" in node.output


def test_a_parameter_file_and_a_namespace_reach_the_node(processes: Processes, tmp_path: Path) -> None:
    path = tmp_path / "parameters.yaml"
    path.write_text(
        "/**:\n  ros__parameters:\n    duration_s: 1\n    startup_timeout_s: 0\n", encoding="utf-8"
    )
    node = processes.start("plant", {}, "--ros-args", "--params-file", str(path), "-r", "__ns:=/other", "--")
    assert node.wait() == 1
    assert "other.plant" in node.output
    assert "duration_s = 1.0 (scenario file: 20.0)" in node.output


@pytest.mark.parametrize("kind", KINDS)
def test_help_needs_no_rclpy(kind: str) -> None:
    code = (
        "import sys; sys.modules['rclpy'] = None;"
        f"from skydiver_utc.nodes.{kind}_node import main; sys.exit(main(['x', '--help']))"
    )
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    for leaf in OWN_PARAMETERS[kind]:
        assert f"  {leaf.name} " in shown
    assert "controller.horizon_steps" in shown
    assert SCENARIO in shown


def test_without_rclpy_there_is_one_sentence() -> None:
    code = (
        "import sys; sys.modules['rclpy'] = None;"
        "from skydiver_utc.nodes.plant_node import main; sys.exit(main(['x']))"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=os.environ)
    assert ended.returncode == 2
    assert len(ended.stderr.strip().splitlines()) == 1
    assert "rclpy" in ended.stderr
