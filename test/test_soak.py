"""The soak in its short form: what it reports, and that nothing is missing."""

import json
import os
import subprocess
import sys
from pathlib import Path

from ros_fixtures import claimed_domain

SOAK = Path(__file__).resolve().parents[1] / "benchmarks" / "soak.py"


def test_a_short_soak_misses_nothing_and_accounts_for_every_step() -> None:
    with claimed_domain() as domain:
        done = subprocess.run(
            [sys.executable, str(SOAK), "--lockstep-s", "4", "--real-time-s", "4"],
            env=os.environ | {"ROS_DOMAIN_ID": str(domain)},
            capture_output=True,
            text=True,
            check=False,
        )
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    lockstep, real_time = told["lockstep"], told["real_time"]
    assert (lockstep["outcome"], lockstep["states"], lockstep["missing"]) == ("completed", 954, {})
    assert real_time["states"] == 954
    assert real_time["missing"] == {}
    account = real_time["real_time"]
    assert sum(account[name] for name in ("on_time", "late", "stale", "lost")) == account["steps"] == 953
    assert set(lockstep["memory_growth_MB"]) <= {"plant", "controller", "reference", "recorder"}
    # Never faster than the clock: the first command begins the time, the last step ends it.
    assert 0.0 < account["rate_Hz"] < 1.00001 * real_time["nominal_rate_Hz"]
