# SPDX-License-Identifier: Apache-2.0
"""What a soak has to hold, bar by bar: see ``soak.py``."""

from collections.abc import Mapping
from typing import Any

MOST_GROWTH_MB = 5.0  # of each node, after the first minute
RATE_WITHIN = 1e-3


def bars(report: Mapping[str, Any]) -> dict[str, bool]:
    """Whether each bar is met by the parts that were flown; a growth that was not measured is none."""
    found: dict[str, bool] = {}
    for part in ("lockstep", "real_time"):
        if part in report:
            flight = report[part]
            growth = flight["memory_growth_MB"]
            found[f"{part}: completed"] = flight["outcome"] == "completed"
            found[f"{part}: no message missing in the bag"] = not flight["missing"]
            found[f"{part}: no node grew by {MOST_GROWTH_MB:g} MB"] = bool(growth) and all(
                megabytes < MOST_GROWTH_MB for megabytes in growth.values()
            )
    if "real_time" in report:
        flight = report["real_time"]
        account, pair, nominal = flight["real_time"], flight["ping_pong"], flight["nominal_rate_Hz"]
        found["real_time: average rate within 0.1 %"] = (
            abs(account["rate_Hz"] - nominal) <= RATE_WITHIN * nominal
        )
        found["real_time: late steps at most twice those of the bare pair"] = (
            account["late_steps"] * pair["count"] <= 2 * pair["late"] * account["steps"]
        )
    return found
