# SPDX-License-Identifier: Apache-2.0
"""The launch files: their arguments, the parameters they give to nodes, and what ends a launch."""

import runpy
import sys
import types
from pathlib import Path
from signal import SIGINT
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml

from skydiver_utc.errors import REFUSED
from skydiver_utc.parameters.nodes import SETTINGS

FOLDER = Path(__file__).resolve().parents[2] / "launch"
CLOSED_LOOP = ElementTree.parse(FOLDER / "closed_loop.launch.xml").getroot()
# The recorder may wait so long for messages that were lost; after that launch sends SIGTERM.
LONGEST_CLOSE_S = 10.0


DEFAULTS = {argument.get("name"): argument.get("default") for argument in CLOSED_LOOP.findall("arg")}


def test_arguments_of_the_closed_loop() -> None:
    choices = ("record", "controller", "estimator", "reference")
    assert {"scenario", "clock", "params_file", *choices} <= set(DEFAULTS)
    assert not str(DEFAULTS["namespace"]).startswith("/")
    assert (DEFAULTS["mode"], DEFAULTS["record"], DEFAULTS["out"]) == ("lockstep", "true", "")
    timeouts = [
        float(e.get("value", "")) for e in CLOSED_LOOP.iter("let") if e.get("name") == "sigterm_timeout"
    ]
    assert min(timeouts) > LONGEST_CLOSE_S


def test_nodes_are_given_parameters_that_they_have() -> None:
    conditions = {}
    for include in CLOSED_LOOP.iter("include"):
        assert include.get("file") == "$(dirname)/node.launch.py"
        given = {argument.get("name"): argument.get("value", "") for argument in include.iter("arg")}
        text = given["parameters"]
        for name, default in DEFAULTS.items():
            text = text.replace(f"$(var {name})", str(default))
        SETTINGS[given["node"]].model_validate(yaml.safe_load(text))
        conditions[given["node"]] = include.get("if")
    of_choice = {node: f"$(var {node})" for node in ("reference", "controller", "estimator")}
    assert conditions == {"plant": None, "recorder": "$(var record)", **of_choice}


class _Node:
    """Stands for launch_ros.actions.Node."""

    def __init__(self, **arguments: Any) -> None:
        self.arguments = arguments
        self.expanded_node_namespace = "/skydiver"


def described(monkeypatch: pytest.MonkeyPatch, **given: str) -> list[_Node]:
    """The nodes of node.launch.py, with stand-ins for the launch system, which PyPI does not have."""

    class Configuration:
        def __init__(self, name: str) -> None:
            self._name = name

        def perform(self, defaults: dict[str, str]) -> str:
            return {**defaults, **given}[self._name]

    def action(kind: str) -> Any:
        return lambda *arguments, **named: types.SimpleNamespace(kind=kind, arguments=arguments, **named)

    stand_ins: dict[str, dict[str, Any]] = {
        "launch": {"LaunchDescription": list},
        "launch.actions": {
            kind: action(kind)
            for kind in ("DeclareLaunchArgument", "EmitEvent", "OpaqueFunction", "Shutdown")
        },
        "launch.events": {},
        "launch.events.process": {"SignalProcess": action("SignalProcess")},
        "launch.substitutions": {"LaunchConfiguration": Configuration},
        "launch_ros": {},
        "launch_ros.actions": {"Node": _Node},
    }
    for name, content in stand_ins.items():
        module = types.ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    *declared, opaque = runpy.run_path(str(FOLDER / "node.launch.py"))["generate_launch_description"]()
    defaults = {argument.arguments[0]: argument.default_value for argument in declared}
    assert all(argument.description for argument in declared)
    nodes: list[_Node] = opaque.function(defaults)
    return nodes


@pytest.mark.parametrize("kind", ["plant", "reference", "controller", "recorder"])
def test_a_node_that_refuses_to_start_ends_the_launch_with_a_reason(
    monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    (node,) = described(monkeypatch, node=kind)
    (shutdown,) = node.arguments["on_exit"](types.SimpleNamespace(returncode=REFUSED), None)
    assert shutdown.kind == "Shutdown"
    assert kind in shutdown.reason


def test_the_end_of_a_plant_ends_the_nodes_of_its_namespace(monkeypatch: pytest.MonkeyPatch) -> None:
    (plant,) = described(monkeypatch, node="plant")
    (emitted,) = plant.arguments["on_exit"](types.SimpleNamespace(returncode=0), None)
    assert emitted.event.signal_number == SIGINT
    near, far = _Node(), _Node()
    far.expanded_node_namespace = "/other"
    assert [emitted.event.process_matcher(node) for node in (near, far, plant)] == [True, False, False]
    (recorder,) = described(monkeypatch, node="recorder")
    assert recorder.arguments["on_exit"](types.SimpleNamespace(returncode=-9), None) == []


def test_a_parameter_file_counts_before_the_arguments(monkeypatch: pytest.MonkeyPatch) -> None:
    given = {"parameters": "{mode: real_time}", "params_file": "mine.yaml", "clock": "/a/clock"}
    (node,) = described(monkeypatch, node="plant", **given)
    arguments = node.arguments
    assert arguments["executable"] == "plant_node"
    assert arguments["parameters"] == [{"mode": "real_time"}, "mine.yaml"]
    assert arguments["remappings"] == [("/clock", "/a/clock"), ("/tf", "/a/tf")]
