"""The rooms' arrows, and that setup.py, package.xml, launch/ and ros2_run/ tell the same story."""

import ast
import os
import re
import runpy
import shutil
import subprocess
import sys
import types
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from skydiver_utc.nodes.node_parameters import OWN_PARAMETERS
from skydiver_utc.nodes.process import _REFUSED

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "skydiver_utc"
NODES = ("plant_node", "reference_node", "controller_node", "recorder_node")
ROS = ("rclpy", "builtin_interfaces", "rosgraph_msgs", "rcl_interfaces", "std_srvs")


def architecture() -> dict[str, set[str]]:
    """The rooms that each room may import, from the table in docs/architecture.md, left to right."""
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    section = text.partition("| room |")[2].partition("\n\n")[0]
    allowed: dict[str, set[str]] = {}
    cells = [re.split(r"\s*\|\s*", line.strip("| ")) for line in section.splitlines()[2:]]
    rooms = [re.sub(r"\.py|[`/]", "", row[0]) for row in cells]
    for room, row in zip(rooms, cells, strict=True):
        words = set(re.findall(r"\w+", row[-1].partition(";")[0]))
        allowed[room] = words & set(rooms)
        if words >= {"all", "above"}:
            allowed[room] |= set(allowed)
        elif words >= {"all", "but"}:
            allowed[room] = set(rooms) - words
        allowed[room].add(room)
    return allowed


def imports(path: Path) -> Iterator[str]:
    """Absolute names of all that a module imports, wherever in it."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def modules() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


def is_ros(name: str) -> bool:
    library = name.split(".")[0]
    return library in ROS or library.endswith("_msgs")


def room_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def test_every_room_is_in_the_table() -> None:
    table = architecture()
    assert table["parameters"] == {"parameters"}
    assert "control" not in table["plant"]
    assert "nodes" not in table["analysis"]
    assert {room_of(path) for path in modules()} - {"__init__"} == set(table)


@pytest.mark.parametrize("room", architecture())
def test_a_room_imports_only_what_the_architecture_allows(room: str) -> None:
    allowed = architecture()[room]
    forbidden = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in modules()
        if room_of(path) == room
        for name in imports(path)
        if name.startswith("skydiver_utc.") and name.split(".")[1] not in allowed
    ]
    assert not forbidden


def test_only_nodes_import_ros() -> None:
    forbidden = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in modules()
        if room_of(path) != "nodes"
        for name in imports(path)
        if is_ros(name)
    ]
    assert not forbidden


@pytest.fixture
def setup_arguments(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What setup.py hands to setuptools."""
    setuptools = pytest.importorskip("setuptools")
    captured: dict[str, Any] = {}
    monkeypatch.setattr(setuptools, "setup", captured.update)
    monkeypatch.chdir(ROOT)
    exec(compile(Path("setup.py").read_text(encoding="utf-8"), "setup.py", "exec"), {})
    return captured


@pytest.fixture
def manifest() -> ElementTree.Element:
    return ElementTree.parse(ROOT / "package.xml").getroot()


def test_setup_and_manifest_agree(setup_arguments: dict[str, Any], manifest: ElementTree.Element) -> None:
    assert manifest.get("format") == "3"
    for tag in ("name", "version", "license", "maintainer"):
        assert manifest.findtext(tag) == setup_arguments[tag]
    assert manifest.findtext("export/build_type") == "ament_python"


def test_manifest_names_every_ros_package_that_is_imported(manifest: ElementTree.Element) -> None:
    imported = {name.split(".")[0] for path in modules() for name in imports(path) if is_ros(name)}
    assert imported <= {element.text for element in manifest.iter("exec_depend")}


def test_setup_declares_every_library_that_is_imported(setup_arguments: dict[str, Any]) -> None:
    declared = {re.split(r"[<>=\[]", requirement)[0] for requirement in setup_arguments["install_requires"]}
    imported = {name.split(".")[0] for path in modules() for name in imports(path) if not is_ros(name)}
    libraries = imported - sys.stdlib_module_names - {"skydiver_utc", "ament_index_python"}
    assert {"pyyaml" if name == "yaml" else name for name in libraries} <= declared


def test_everything_that_is_read_at_run_time_is_installed(setup_arguments: dict[str, Any]) -> None:
    installed = {
        f"{target}/{Path(source).name}": source
        for target, sources in setup_arguments["data_files"]
        for source in sources
    }
    assert "share/ament_index/resource_index/packages/skydiver_utc" in installed
    assert "share/skydiver_utc/package.xml" in installed
    for folder in ("config", "launch"):
        for path in (ROOT / folder).rglob("*.*"):
            relative = path.relative_to(ROOT).as_posix()
            assert installed[f"share/skydiver_utc/{relative}"] == relative
    for node in NODES:
        assert os.access(ROOT / installed[f"lib/skydiver_utc/{node}"], os.X_OK)


def test_console_scripts_lead_to_functions(setup_arguments: dict[str, Any]) -> None:
    scripts = dict(entry.split(" = ") for entry in setup_arguments["entry_points"]["console_scripts"])
    assert set(scripts) == {"skydiver-utc", *NODES}
    for target in scripts.values():
        module, _, function = target.partition(":")
        tree = ast.parse((ROOT / (module.replace(".", "/") + ".py")).read_text(encoding="utf-8"))
        names = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
        assert function in names, f"{target} does not exist"


LAUNCH_FILES = pytest.mark.parametrize(
    "path", sorted((ROOT / "launch").glob("*.launch.xml")), ids=lambda path: path.name
)


@LAUNCH_FILES
def test_launch_files_start_nodes_that_exist_with_parameters_that_exist(path: Path) -> None:
    nodes = list(ElementTree.parse(path).getroot().iter("node"))
    assert nodes
    for node in nodes:
        assert node.get("pkg") == "skydiver_utc"
        assert node.get("exec") in NODES
        known = {leaf.name for leaf in OWN_PARAMETERS[node.get("exec", "").removesuffix("_node")]}
        given = {parameter.get("name"): parameter.get("value") for parameter in node.iter("param")}
        assert set(given) <= known
        for name in {"mode", "delay_steps"} & known:
            assert given[name] == f"$(var {name})"


@LAUNCH_FILES
def test_every_recorder_is_that_of_the_launch_file_for_one(path: Path) -> None:
    root = ElementTree.parse(path).getroot()
    plants = [node for node in root.iter("node") if node.get("exec") == "plant_node"]
    recorders = list(root.iter("include"))
    assert "recorder_node" not in {node.get("exec") for node in root.iter("node")}
    assert len(recorders) == len(plants) > 0
    for recorder in recorders:
        assert recorder.get("file") == "$(dirname)/recorder.launch.py"
        assert {argument.get("name") for argument in recorder.iter("arg")} == {"scenario", "bag_folder"}


def test_a_recorder_that_cannot_begin_ends_the_launch_and_no_other_does(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With stand-ins for the launch system, which PyPI does not have."""

    def noted(kind: str) -> Any:
        return lambda *arguments, **named: (kind, arguments, named)

    stand_ins = {
        "launch": {"LaunchDescription": list},
        "launch.actions": {n: noted(n) for n in ("DeclareLaunchArgument", "Shutdown")},
        "launch.substitutions": {"LaunchConfiguration": noted("LaunchConfiguration")},
        "launch_ros": {},
        "launch_ros.actions": {"Node": noted("Node")},
        "launch_ros.parameter_descriptions": {"ParameterValue": noted("ParameterValue")},
    }
    for name, content in stand_ins.items():
        module = types.ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    described = runpy.run_path(str(ROOT / "launch" / "recorder.launch.py"))
    *arguments, (kind, _, node) = described["generate_launch_description"]()
    assert (kind, node["package"], node["executable"]) == ("Node", "skydiver_utc", "recorder_node")
    (given,) = node["parameters"]
    assert [names[0] for _, names, _ in arguments] == list(given) == ["scenario", "bag_folder"]
    assert set(given) <= {leaf.name for leaf in OWN_PARAMETERS["recorder"]}
    for code, ends in ((0, False), (1, False), (-9, False), (_REFUSED, True)):
        follows = node["on_exit"](types.SimpleNamespace(returncode=code), None)
        assert [kind for kind, *_ in follows] == ["Shutdown"] * ends


@LAUNCH_FILES
def test_a_launch_file_may_be_launched_twice_and_flies_in_lockstep_unless_told_otherwise(path: Path) -> None:
    arguments = {a.get("name"): a.get("default") for a in ElementTree.parse(path).getroot().iter("arg")}
    assert (arguments["mode"], arguments["delay_steps"]) == ("lockstep", "0")
    # Empty: the recorder takes a folder with the time in its name.
    assert arguments["output_folder"] == "" or "$(anon " in str(arguments["output_folder"])


def executable(path: Path, script: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
    path.chmod(0o755)
    return path


@pytest.mark.parametrize("node", NODES)
def test_ros2_run_reaches_the_script_that_pip_installed(node: str, tmp_path: Path) -> None:
    executable(tmp_path / "bin" / node, 'echo "script: $*"')
    wrapper = tmp_path / "lib" / "skydiver_utc" / node
    wrapper.parent.mkdir(parents=True)
    shutil.copy(ROOT / "ros2_run" / node, wrapper)
    done = subprocess.run([wrapper, "a b", "c"], capture_output=True, text=True, check=True)
    assert done.stdout == "script: a b c\n"


def test_ros2_run_reaches_the_module_where_there_is_no_script(tmp_path: Path) -> None:
    python = executable(tmp_path / "path" / "python3", 'echo "python: $*"')
    wrapper = tmp_path / "lib" / "skydiver_utc" / "plant_node"
    wrapper.parent.mkdir(parents=True)
    wrapper.symlink_to(ROOT / "ros2_run" / "plant_node")
    environment = {"PATH": f"{python.parent}:{os.environ['PATH']}"}
    done = subprocess.run([wrapper, "a"], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == "python: -m skydiver_utc.nodes.plant_node a\n"


@pytest.mark.parametrize("node", NODES)
def test_the_installed_node_explains_itself(node: str) -> None:
    try:
        distribution("skydiver_utc")
    except PackageNotFoundError:
        pytest.skip("skydiver_utc is not installed, only on the path")
    wrapper = Path(sys.prefix) / "lib" / "skydiver_utc" / node
    done = subprocess.run([wrapper, "--help"], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.startswith(f"usage: {node}")
