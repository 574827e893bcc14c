# SPDX-License-Identifier: Apache-2.0
"""The benchmark of the ROS loop in its short form: both loops fly every step, and the bar is what is asked for."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from ros_domains import reserved_domain

pytestmark = pytest.mark.long

BENCHMARK = Path(__file__).resolve().parents[2] / "benchmarks" / "four_processes.py"


def test_both_loops_fly_every_step_and_are_compared_as_asked() -> None:
    with reserved_domain() as domain:
        done = subprocess.run(
            [sys.executable, str(BENCHMARK), "--turns", "1", "--duration-s", "1", "--json"],
            env=os.environ | {"ROS_DOMAIN_ID": str(domain)},
            capture_output=True,
            text=True,
            check=False,
        )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    bare, ours = found["bare"], found["ours"]
    assert bare["steps"] == ours["steps"] == 239
    assert len(found["ratio_of_each_turn"]) == 1
    assert found["allowed_step_ms"] == pytest.approx(1.2 * bare["step_ms"] + found["solve_ms"])
    assert found["step_within_bar"] == (ours["step_ms"] <= found["allowed_step_ms"])
    assert found["ratio"] == pytest.approx((ours["step_ms"] - found["solve_ms"]) / bare["step_ms"])
    assert 0.0 < found["solve_ms"] < ours["step_ms"]
    assert found["real_time_factor"] == pytest.approx(ours["rate_Hz"] * 0.0042)
