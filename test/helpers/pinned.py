# SPDX-License-Identifier: Apache-2.0
"""The metrics of every scenario to three digits, which test/loop/test_closed_loop.py flies."""

import json
from pathlib import Path
from typing import Any

PINNED: dict[str, dict[str, Any]] = json.loads(
    (Path(__file__).parents[1] / "data" / "metrics.json").read_text(encoding="utf-8")
)
