"""Shared by all tests: where the oracle and the benchmarks lie, and how ROS behaves under test."""

import os
import sys
from pathlib import Path

from hypothesis import settings

# Before rclpy is imported anywhere: field checks on, traffic kept on this machine.
os.environ.setdefault("ROS_PYTHON_CHECK_FIELDS", "1")
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
sys.path[:0] = [str(Path(__file__).parent / "oracle"), str(Path(__file__).parents[1] / "benchmarks")]
# No example is timed: the machine may be shared.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")
