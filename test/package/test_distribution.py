# SPDX-License-Identifier: Apache-2.0
"""What is distributed: setup.py, package.xml, launch/ and ros2_run/ agree with the code and with each other."""

import os
import pydoc
import re
import shutil
import subprocess
import sys
from importlib import import_module
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from command_line import call
from package_files import PACKAGE, ROOT, imports, is_ros, modules

import skydiver_utc

NODES = tuple(path.stem for path in (PACKAGE / "nodes").glob("*_node.py"))
# Libraries by another name than their distribution, or that come with another one.
DISTRIBUTIONS = {
    "yaml": "pyyaml",
    **dict.fromkeys(("pydantic_core", "typing_extensions"), "pydantic"),
}


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
    assert skydiver_utc.__version__ == setup_arguments["version"]
    assert (PACKAGE / "py.typed").is_file()
    assert "py.typed" in setup_arguments["package_data"]["skydiver_utc"]


def test_help_shows_the_public_names_and_the_package_is_a_command() -> None:
    shown = pydoc.render_doc(skydiver_utc, renderer=pydoc.plaintext)
    for name in skydiver_utc.__all__:
        assert hasattr(skydiver_utc, name)
        assert name in shown
    public = {"Plant", "Controller", "Scenario", "simulate", "UnscentedTransformController"}
    assert public <= set(skydiver_utc.__all__)
    with pytest.raises(AttributeError):
        skydiver_utc.nothing  # noqa: B018
    code, stdout, _ = call("--help", folder=ROOT)
    assert (code, "simulate" in stdout) == (0, True)


def test_manifest_names_every_ros_package_that_is_imported(manifest: ElementTree.Element) -> None:
    imported = {name.split(".")[0] for path in modules() for name in imports(path) if is_ros(name)}
    assert imported <= {element.text for element in manifest.iter("exec_depend")}


def test_setup_declares_every_library_that_is_imported(setup_arguments: dict[str, Any]) -> None:
    requirements = [*setup_arguments["install_requires"], *setup_arguments["extras_require"]["studies"]]
    declared = {re.split(r"[<>=\[]", requirement)[0] for requirement in requirements}
    imported = {name.split(".")[0] for path in modules() for name in imports(path) if not is_ros(name)}
    libraries = imported - sys.stdlib_module_names - {"skydiver_utc", "ament_index_python"}
    assert {DISTRIBUTIONS.get(name, name) for name in libraries} == declared


# Libraries for which rosdep has no key.
WITHOUT_KEY = {"cmaes", "daqp", "lz4", "mcap", "viser", "zstandard"}
KEYS = {"pyyaml": "python3-yaml", "rosbags": "python3-rosbags-pip"}


def test_manifest_names_every_library_of_setup_that_rosdep_knows(
    setup_arguments: dict[str, Any], manifest: ElementTree.Element
) -> None:
    libraries = {re.split(r"[<>=\[]", requirement)[0] for requirement in setup_arguments["install_requires"]}
    wanted = {KEYS.get(name, f"python3-{name}") for name in libraries - WITHOUT_KEY}
    named = {str(element.text) for element in manifest.iter("exec_depend")}
    assert {name for name in named if name.startswith("python3-")} == wanted
    assert {"launch", "launch_ros", "launch_xml"} <= named


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
        assert callable(getattr(import_module(module), function)), f"{target} does not exist"


@pytest.mark.parametrize("path", sorted((ROOT / "launch").glob("*.launch.xml")), ids=lambda path: path.name)
def test_every_launch_argument_has_a_default_and_a_description(path: Path) -> None:
    root = ElementTree.parse(path).getroot()
    arguments = root.findall("arg")
    assert {"scenario", "mode"} <= {argument.get("name") for argument in arguments}
    for argument in arguments:
        assert argument.get("default") is not None
        assert argument.get("description")
    for include in root.iter("include"):
        assert (path.parent / include.get("file", "").removeprefix("$(dirname)/")).is_file()


@pytest.mark.parametrize("place", ["bin/plant_node", "path/python3"])
def test_ros2_run_reaches_the_script_that_pip_installed_or_else_the_module(
    place: str, tmp_path: Path
) -> None:
    script, wrapper = tmp_path / place, tmp_path / "lib" / "skydiver_utc" / "plant_node"
    for path in (script, wrapper):
        path.parent.mkdir(parents=True)
    shutil.copy(ROOT / "ros2_run" / "plant_node", wrapper)
    script.write_text('#!/bin/sh\necho "$*"\n', encoding="utf-8")
    script.chmod(0o755)
    environment = {"PATH": f"{tmp_path / 'path'}:{os.environ['PATH']}"}
    command = [wrapper, "a b", "c"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    code = "-c from skydiver_utc.nodes.process import plant_node; raise SystemExit(plant_node()) "
    assert done.stdout == f"{'' if script.parent.name == 'bin' else code}a b c\n"


@pytest.mark.parametrize("node", NODES)
def test_the_installed_node_explains_itself(node: str) -> None:
    try:
        distribution("skydiver_utc")
    except PackageNotFoundError:
        pytest.skip("skydiver_utc is not installed, only on the path")
    wrapper = Path(sys.prefix) / "lib" / "skydiver_utc" / node
    done = subprocess.run([wrapper, "--help"], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.startswith(f"usage: {node}")
