# SPDX-License-Identifier: Apache-2.0
"""Seconds and nanoseconds."""

from typing import Any

NANOSECONDS = 1_000_000_000  # in a second


def stamp_ns(stamp: Any) -> int:
    """A builtin_interfaces/Time, or anything with `sec` and `nanosec`, in ns."""
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def seconds(time_ns: float) -> float:
    """A time in ns, in s."""
    return time_ns / NANOSECONDS
