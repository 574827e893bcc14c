# SPDX-License-Identifier: Apache-2.0
"""Tables on stdout of any width, a pipe's 80 columns above all: no value is cut, none is -0.0."""

import re

import pytest
from click.testing import CliRunner
from rich.table import Table

from skydiver_utc.cli.main import main
from skydiver_utc.cli.screen import show_tables


def shown(posture: str, width: int) -> str:
    """The tables of `trim` on so many columns."""
    result = CliRunner().invoke(main, ["trim", posture], env={"COLUMNS": str(width)})
    assert result.exit_code == 0, result.output
    return result.stdout


def words(printed: str) -> list[str]:
    """Sorted, without the frames: a name may go over several lines, a value may not."""
    return sorted(re.sub(r"[^\w\s.,±+:=/-]", " ", printed).split())


def test_trim_cuts_no_value() -> None:
    wide = shown("head_down", 300)
    for width in (80, 20):
        narrow = shown("head_down", width)
        assert "…" not in narrow
        assert words(narrow) == words(wide)
        assert width < 80 or max(map(len, narrow.splitlines())) <= 80
    assert not re.search(r"-0\.0+(?!\d)", wide)


def test_a_table_wider_than_the_screen_is_printed_whole(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "10")
    table = Table()
    table.add_column("value", no_wrap=True)
    table.add_row("0123456789" * 9)
    show_tables(table)
    assert "0123456789" * 9 in capsys.readouterr().out
