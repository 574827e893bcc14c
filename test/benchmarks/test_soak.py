# SPDX-License-Identifier: Apache-2.0
"""The soak in its short form: what it reports, and that nothing is missing."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from ros_domains import reserved_domain
from soak import bars

pytestmark = pytest.mark.long

SOAK = Path(__file__).resolve().parents[2] / "benchmarks" / "soak.py"


def test_a_short_soak_misses_nothing_and_accounts_for_every_step() -> None:
    with reserved_domain() as domain:
        done = subprocess.run(
            [sys.executable, str(SOAK), "--lockstep-s", "0", "--real-time-s", "4"],
            env=os.environ | {"ROS_DOMAIN_ID": str(domain)},
            capture_output=True,
            text=True,
            check=False,
        )
    assert done.returncode in (0, 1), done.stderr
    found = json.loads(done.stdout)
    assert found["bars"] == bars(found)
    assert done.returncode == (not all(found["bars"].values()))
    # Four seconds tell nothing of growth, and on a busy machine nothing of lateness.
    assert found["bars"]["real_time: no message missing in the bag"], found
    real_time = found["real_time"]
    assert real_time["states"] == 954
    account = real_time["real_time"]
    assert sum(account[name] for name in ("on_time", "late", "stale", "lost")) == account["steps"] == 953
    # Never faster than the clock: the first command begins the time, the last step ends it.
    assert 0.0 < account["rate_Hz"] < 1.00001 * real_time["nominal_rate_Hz"]


def report(**changed: object) -> dict[str, Any]:
    """Of a real-time flight that meets every bar, but for what is changed."""
    flight = {
        "outcome": "completed",
        "missing": {},
        "memory_growth_MB": {"plant": 0.4, "recorder": 4.9},
        "nominal_rate_Hz": 238.095,
        "real_time": {"steps": 100_000, "late_steps": 4, "rate_Hz": 238.0},
        "ping_pong": {"count": 50_000, "late": 1},
    }
    return {"real_time": flight | changed}


@pytest.mark.parametrize(
    ("changed", "missed"),
    [
        ({}, set()),
        ({"outcome": "no_command"}, {"completed"}),
        ({"missing": {"/clock": 1}}, {"no message missing in the bag"}),
        ({"memory_growth_MB": {"plant": 5.0}}, {"no node grew by 5 MB"}),
        ({"memory_growth_MB": {}}, {"no node grew by 5 MB"}),
        (
            {"real_time": {"steps": 100_000, "late_steps": 5, "rate_Hz": 238.0}},
            {"late steps at most twice those of the bare pair"},
        ),
        (
            {"real_time": {"steps": 100_000, "late_steps": 0, "rate_Hz": 237.8}},
            {"average rate within 0.1 %"},
        ),
    ],
)
def test_a_bar_that_is_missed_is_told(changed: dict[str, object], missed: set[str]) -> None:
    found = bars(report(**changed))
    assert {name.removeprefix("real_time: ") for name, met in found.items() if not met} == missed
    assert len(found) == 5
