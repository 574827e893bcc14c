"""Tables on stdout of any width, a pipe's 80 columns above all: no value is cut, none is -0.0."""

import re

import pytest
from rich.table import Table

from skydiver_utc.parameters import load_scenario
from skydiver_utc.parameters.loading import config_folder
from skydiver_utc.verbs import trim
from skydiver_utc.verbs.screen import show_tables

POSTURES = sorted(path.stem for path in (config_folder() / "postures").glob("*.yaml"))


def shown(values, width, monkeypatch, capsys):
    """What trim prints of its values on so many columns."""
    monkeypatch.setenv("COLUMNS", str(width))
    trim._show(values)
    return capsys.readouterr().out


@pytest.mark.parametrize("posture", POSTURES)
def test_trim_cuts_no_value_of_any_posture(posture, monkeypatch, capsys):
    values = trim.report(load_scenario("bank_recovery", {"posture": posture}))
    wide = shown(values, 300, monkeypatch, capsys)
    for width in (80, 20):
        narrow = shown(values, width, monkeypatch, capsys)
        assert "…" not in narrow
        assert words(narrow) == words(wide)
    assert max(map(len, shown(values, 80, monkeypatch, capsys).splitlines())) <= 80
    assert not re.search(r"-0\.0+(?!\d)", wide)


def words(printed):
    """Sorted, without the frames: a name may go over several lines, a value may not."""
    return sorted(re.sub(r"[^\w\s.,±+:=/-]", " ", printed).split())


def test_the_longest_mode_that_can_be_fits_80_columns(monkeypatch, capsys):
    mode = {
        "name": "fall rate oscillation 2",
        "stable": False,
        "eigenvalue_1_s": [-0.000123, 0.00045],
        "time_constant_s": 0.000123,
        "frequency_hz": 0.000123,
        "damping_ratio": 0.000123,
    }
    monkeypatch.setenv("COLUMNS", "80")
    show_tables(trim._table_of_modes({"Cm_damp_yaw": 0.5, "modes": [mode]}))
    printed = capsys.readouterr().out
    assert "-0.000123 ± 0.00045i" in printed
    assert printed.count(" 0.000123 ") == 3
    assert "unstable" in printed
    assert "…" not in printed


def test_a_table_wider_than_the_screen_is_printed_whole(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "10")
    table = Table()
    table.add_column("value", no_wrap=True)
    table.add_row("0123456789" * 9)
    show_tables(table)
    assert "0123456789" * 9 in capsys.readouterr().out
