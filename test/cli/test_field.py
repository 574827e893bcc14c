# SPDX-License-Identifier: Apache-2.0
"""Every command that reads files, over the files of test/data/field, as the table there says."""

import json
import math
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result
from command_line import invoke

FIELD = Path(__file__).resolve().parents[1] / "data" / "field"
TABLE = re.findall(r"^\| (\S+) \| .* \| (read|refused) \|$", (FIELD / "README.md").read_text(), re.MULTILINE)


def told(*arguments: object) -> Result:
    """A command; what it says may be anything but a traceback or escape sequences."""
    result = invoke(*arguments)
    assert result.exception is None or isinstance(result.exception, SystemExit), (arguments, result.exc_info)
    assert "\x1b" not in result.output
    if result.exit_code == 2:
        assert len(result.stderr.strip().splitlines()) == 1, arguments
        assert result.stdout == ""
    return result


def commands(path: Path, scratch: Path) -> Iterator[tuple[object, ...]]:
    """What reads a kind of file; the first one's exit code is that of the table."""
    if path.suffix == ".yaml":
        yield "simulate", path, "--quiet", "--json"
        yield "scenarios", "--show", path
        yield "stability", "--plant", path, "--json"
        yield "pattern", "show", path, "--json"
        yield "calibrate", path, "--out", scratch / "calibrated"
    elif path.suffix in (".csv", ".mot", ".sto"):
        yield "pattern", "extract", path, "--json"
        yield "pattern", "import", path, "--out", scratch / "path.yaml"
    else:
        run = scratch / "run"
        if path.is_dir():
            shutil.copytree(path, run)
        else:
            run.mkdir()
            shutil.copy(path, run / path.name)
        yield "analyse", run, "--json"
        yield "replay", run, "--check", "--json"
        yield "pattern", "extract", run
        yield "recover", run, "--json"


def numbers(value: Any) -> Iterator[float]:
    if isinstance(value, float):
        yield value
    elif isinstance(value, dict | list):
        for item in value.values() if isinstance(value, dict) else value:
            yield from numbers(item)


def test_the_table_is_complete() -> None:
    assert sorted(name for name, _ in TABLE) == sorted(
        p.name for p in FIELD.iterdir() if p.name != "README.md"
    )


@pytest.mark.usefixtures("unrendered")
@pytest.mark.parametrize(("name", "expected"), TABLE)
def test_every_command_reads_or_refuses(name: str, expected: str, tmp_path: Path) -> None:
    def sizes() -> dict[Path, int]:
        return {path: path.stat().st_size for path in tmp_path.rglob("*") if path.name != "calibrated"}

    for place, arguments in enumerate(commands(FIELD / name, tmp_path)):
        before = sizes()
        result = told(*arguments)
        if place == 0:
            assert (result.exit_code == 0) == (expected == "read"), result.output
        if result.exit_code == 2:
            assert sizes() == before
        elif "--json" in arguments:
            assert all(map(math.isfinite, numbers(json.loads(result.stdout)))), result.stdout
