# SPDX-License-Identifier: Apache-2.0
"""The state of runs over ROS, as lines and on a terminal."""

import io

import pytest
from rich.console import Console

from skydiver_utc.cli import run_status
from skydiver_utc.cli.run_status import RunStatus
from skydiver_utc.parameters import load_scenario

REPORT = {"step": 100, "steps": 200, "outputs": {"yaw_rate": 0.0}, "controls": {"alpha": 0.25}, "late": 3}


@pytest.mark.parametrize("terminal", [True, False])
def test_phase_error_controls_and_late_answers_are_shown(monkeypatch, terminal):
    scenario = load_scenario("turn_360_left", {"reference.start_s": 0.0})
    written = io.StringIO()
    console = Console(file=written, force_terminal=terminal, width=200)
    monkeypatch.setattr(run_status, "Console", lambda **_: console)
    monkeypatch.setattr(run_status, "LINE_PERIOD_S", 0.0)
    with RunStatus({"anna": scenario, "[b]": scenario}, quiet=False) as status:
        status.show("anna", REPORT)
        status.show("[b]", {**REPORT, "late": None})
        status.show("anna", {"outcome": "rolled_over"})
    text = written.getvalue()
    wanted = -float(scenario.reference.shape().value(100 * scenario.dt_s)) * 57.29578
    for word in ("anna", "[b]", "flying", "alpha 0.25", "3", f"{wanted:.3g} deg/s", "rolled over"):
        assert word in text
