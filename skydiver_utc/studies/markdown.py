# SPDX-License-Identifier: Apache-2.0
"""Figures and tables in Markdown."""

import math
from collections.abc import Iterable, Sequence


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table with one line per row."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def figure(value: float | None) -> str:
    """Two digits of a measured value, whole numbers from 10 on."""
    if value is None or value == math.inf:
        return "-"
    return f"{value:.0f}" if abs(value) >= 9.95 else f"{value:.1f}" if abs(value) >= 0.995 else f"{value:.2f}"


def percent(share: float) -> str:
    """A share in whole percent."""
    return f"{100.0 * share:.0f} %"
