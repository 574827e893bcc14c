# SPDX-License-Identifier: Apache-2.0
"""Shared by all tests: where the oracle, the helpers and the benchmarks lie, and how ROS behaves under test."""

import os
import sys
from pathlib import Path

import pytest
from hypothesis import settings

HERE = Path(__file__).parent
# Before rclpy is imported anywhere: field checks on, traffic kept on this machine.
os.environ.setdefault("ROS_PYTHON_CHECK_FIELDS", "1")
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
sys.path[:0] = [str(HERE / "helpers"), str(HERE / "oracle"), str(HERE.parent / "benchmarks")]
# No example is timed: the machine may be shared.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")


@pytest.fixture
def unrendered(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures are made, but not rendered: test/analysis/test_figures.py renders those of odd runs."""
    monkeypatch.setattr("skydiver_utc.analysis.style.png", lambda figure: b"\x89PNG")
