# SPDX-License-Identifier: Apache-2.0
"""Message definitions and hashes against the wheels' own files and, independently, against rosbags."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from skydiver_utc.errors import RecordingError
from skydiver_utc.recording.schemas import message_schema

pytest.importorskip("nav_msgs")

TYPES = (
    "nav_msgs/msg/Odometry",
    "sensor_msgs/msg/JointState",
    "trajectory_msgs/msg/JointTrajectory",
    "geometry_msgs/msg/TwistStamped",
    "rosgraph_msgs/msg/Clock",
    "std_msgs/msg/String",
    "std_msgs/msg/Empty",
    "visualization_msgs/msg/MarkerArray",
    "diagnostic_msgs/msg/DiagnosticArray",
)


def installed(type_name: str, suffix: str) -> str:
    package, _, message = type_name.split("/")
    module = sys.modules.get(package) or __import__(package)
    for parent in Path(module.__file__).parents:
        file = parent / "share" / package / "msg" / f"{message}{suffix}"
        if file.is_file():
            return file.read_text(encoding="utf-8")
    raise AssertionError(f"{type_name}{suffix} is not installed")


@pytest.mark.parametrize("type_name", TYPES)
def test_hash_and_text_are_those_of_the_package_and_of_rosbags(type_name):
    schema, jazzy = message_schema(type_name), get_typestore(Stores.ROS2_JAZZY)
    hashes = json.loads(installed(type_name, ".json"))["type_hashes"]
    assert schema.type_name == type_name
    assert {"type_name": type_name, "hash_string": schema.type_hash} in hashes
    types = get_types_from_msg(schema.text, type_name)
    own = get_typestore(Stores.EMPTY)
    own.register(types)
    assert schema.type_hash == own.hash_rihs01(type_name) == jazzy.hash_rihs01(type_name)
    for name in types:
        assert own.fielddefs[name] == jazzy.fielddefs[name]


def test_text_has_the_form_of_ros2msg():
    schema = message_schema("nav_msgs/msg/Odometry")
    root, *dependencies = schema.text.split("\n" + "=" * 80 + "\n")
    assert root == installed("nav_msgs/msg/Odometry", ".msg")
    names = []
    for dependency in dependencies:
        head, _, text = dependency.partition("\n")
        package, message = head.removeprefix("MSG: ").split("/")
        names.append(f"{package}/{message}")
        assert text == installed(f"{package}/msg/{message}", ".msg")
    assert sorted(names) == [
        "builtin_interfaces/Time",
        "geometry_msgs/Point",
        "geometry_msgs/Pose",
        "geometry_msgs/PoseWithCovariance",
        "geometry_msgs/Quaternion",
        "geometry_msgs/Twist",
        "geometry_msgs/TwistWithCovariance",
        "geometry_msgs/Vector3",
        "std_msgs/Header",
    ]


@pytest.mark.parametrize("type_name", ["nowhere_msgs/msg/Nothing", "std_msgs/msg/Nothing"])
def test_unknown_type_is_named(type_name):
    with pytest.raises(RecordingError, match=type_name):
        message_schema(type_name)


@pytest.mark.parametrize("type_name", ["Odometry", "nav_msgs/Odometry", "../msg/Odometry", "a/msg/../B", ""])
def test_what_is_no_type_name(type_name):
    with pytest.raises(RecordingError, match="is not a message type"):
        message_schema(type_name)


def install(prefix: Path, package: str, text: str) -> str:
    """Put one message package into a prefix and return the name of its type."""
    folder = prefix / "share" / package / "msg"
    folder.mkdir(parents=True)
    type_name = f"{package}/msg/Thing"
    (folder / "Thing.msg").write_text(text)
    (folder / "Thing.json").write_text(
        json.dumps({"type_hashes": [{"type_name": type_name, "hash_string": "RIHS01_" + text[:4]}]})
    )
    return type_name


def test_package_of_a_sourced_environment(tmp_path, monkeypatch):
    type_name = install(tmp_path / "second", "sourced_msgs", "bool value\n")
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path / 'first'}:{tmp_path / 'second'}")
    assert message_schema(type_name) == (type_name, "bool value\n", "RIHS01_bool")


def test_definitions_beside_the_importable_package_come_first(tmp_path, monkeypatch):
    type_name = install(tmp_path / "sourced", "twice_msgs", "bool value\n")
    install(tmp_path / "imported", "twice_msgs", "int8 value\n")
    site = tmp_path / "imported" / "lib" / "python3" / "site-packages"
    (site / "twice_msgs").mkdir(parents=True)
    (site / "twice_msgs" / "__init__.py").write_text("raise ImportError('not to be imported')\n")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "sourced"))
    monkeypatch.syspath_prepend(site)
    assert message_schema(type_name).text == "int8 value\n"


def test_nothing_of_ros_is_imported():
    code = (
        "import sys\n"
        "from skydiver_utc.recording import reader, schemas, stamps, writer\n"
        "schemas.message_schema('nav_msgs/msg/Odometry')\n"
        "print([name for name in sys.modules if name.startswith(('rclpy', 'nav_msgs', 'ament'))])\n"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"
