# SPDX-License-Identifier: Apache-2.0
"""The modules of the package, and what they import."""

import ast
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "skydiver_utc"
_ROS = ("rclpy", "builtin_interfaces", "rosgraph_msgs", "rcl_interfaces", "std_srvs")


@cache
def modules() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


@cache
def imports(path: Path) -> list[str]:
    """Absolute names of all that a module imports, wherever in it."""
    names = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    return names


def is_ros(name: str) -> bool:
    library = name.split(".")[0]
    return library in _ROS or library.endswith("_msgs")
