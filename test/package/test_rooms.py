# SPDX-License-Identifier: Apache-2.0
"""Rooms import only what docs/architecture.md allows, and every file has its licence line."""

import ast
import re
from pathlib import Path

from package_files import PACKAGE, ROOT, imports, is_ros, modules


def allowed_imports() -> dict[str, set[str]]:
    """The rooms that each room may import, from the table in docs/architecture.md, top to bottom."""
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    section = text.partition("| room |")[2].partition("\n\n")[0]
    allowed: dict[str, set[str]] = {}
    for line in section.splitlines()[2:]:
        room, *_, may_import = (cell.strip() for cell in line.strip("| ").split("|"))
        room = re.sub(r"\.py|[`/]", "", room)
        named = set(re.findall(r"\w+", may_import))
        above = set(allowed)
        assert named <= above | {"all", "above"}, f"{room} may import a room below it"
        allowed[room] = {room, "arrays", "errors"} | (above if "all" in named else named)
    return allowed


ALLOWED = allowed_imports()


def room_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def test_every_room_is_in_the_table() -> None:
    assert {room_of(path) for path in modules()} - {"__init__", "__main__"} == set(ALLOWED)
    assert ALLOWED["parameters"] == {"parameters", "arrays", "errors"}


def test_a_room_imports_only_what_the_table_allows() -> None:
    for path in modules():
        room = room_of(path)
        for name in imports(path) if room in ALLOWED else ():
            own = name.removesuffix(".__version__").startswith("skydiver_utc.")
            assert not own or name.split(".")[1] in ALLOWED[room], (path, name)
            assert not is_ros(name) or room == "nodes", (path, name)


def test_every_file_has_its_licence_line() -> None:
    """And every module of the package says what it is for."""
    folders = ("skydiver_utc", "test", "benchmarks", "examples", "launch")
    files = [path for folder in folders for path in (ROOT / folder).rglob("*.py") if path.stat().st_size]
    licence = "# SPDX-License-Identifier: Apache-2.0\n"
    assert not [path for path in files if not path.read_text(encoding="utf-8").startswith(licence)]
    undocumented = [
        path
        for path in modules()
        if path.stat().st_size and not ast.get_docstring(ast.parse(path.read_text("utf-8")))
    ]
    assert not undocumented
