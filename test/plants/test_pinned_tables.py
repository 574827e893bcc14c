# SPDX-License-Identifier: Apache-2.0
"""Tables of `trim` and `pattern show` as they are: any other number is seen. The oracles hold the forces behind them.

`PYTHONPATH=. python test/plants/test_pinned_tables.py` writes them again after a change that is meant.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from skydiver_utc.parameters import load_scenario
from skydiver_utc.plants.skydiver.fall_report import fall_report
from skydiver_utc.plants.skydiver.pattern_report import pattern_report

FILE = Path(__file__).parents[1] / "data" / "tables.json"
TABLES = {
    "trim": lambda: fall_report(load_scenario("fast_turn_unknown_dynamics")),
    "trim box": lambda: fall_report(load_scenario("bank_recovery", {"plant.posture": "box"})),
    "pattern show turn": lambda: pattern_report(load_scenario("fast_turn_unknown_dynamics")),
}


def assert_alike(found: Any, kept: Any, place: str) -> None:
    """The same texts; numbers to five digits, or nothing beside the largest of their list."""
    if isinstance(kept, dict):
        assert list(found) == list(kept), place
        for name in kept:
            assert_alike(found[name], kept[name], f"{place}.{name}")
    elif isinstance(kept, list) and any(isinstance(item, float) for item in kept):
        sizes = np.array(kept, dtype=float)
        np.testing.assert_allclose(
            np.array(found, dtype=float), sizes, 1e-5, 1e-8 + 1e-5 * np.abs(sizes).max()
        )
    elif isinstance(kept, list):
        assert len(found) == len(kept), place
        for i, (new, old) in enumerate(zip(found, kept, strict=True)):
            assert_alike(new, old, f"{place}[{i}]")
    elif isinstance(kept, float):
        assert found == pytest.approx(kept, rel=1e-5, abs=1e-6 if "residual" in place else 1e-8), place
    else:
        assert found == kept, place


@pytest.mark.parametrize("name", TABLES)
def test_a_table_is_as_it_was(name: str) -> None:
    kept = json.loads(FILE.read_text(encoding="utf-8"))[name]
    assert_alike(json.loads(json.dumps(TABLES[name]())), kept, name)


def seven_digits(text: str) -> float:
    return round(float(f"{float(text):.7g}"), 12)


if __name__ == "__main__":
    tables = {
        name: json.loads(json.dumps(table()), parse_float=seven_digits) for name, table in TABLES.items()
    }
    lines = ",\n".join(f"{json.dumps(name)}: {json.dumps(table)}" for name, table in tables.items())
    FILE.write_text(f"{{{lines}}}\n", encoding="utf-8")
