# SPDX-License-Identifier: Apache-2.0
"""What the quick start compiles with a plant of plain Python: nothing."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
COUNT = """
from numba.core import event
with event.install_recorder("numba:compile") as recorder:
    exec(compile(open({path!r}).read(), {path!r}, "exec"))
print("compilations:", sum(record.is_start for _, record in recorder.buffer))
"""
PLAIN = ("@njit  # optional: plain Python works too, more slowly\n", "from numba import njit\n")


def test_a_plain_plant_compiles_nothing(tmp_path):
    """The README's quick start, less the lines of its jitted plant, in a new process."""
    page = (ROOT / "README.md").read_text(encoding="utf-8")
    code = page.split("```python\n", 1)[1].split("```", 1)[0]
    for line in PLAIN:
        assert line in code
        code = code.replace(line, "")
    path = tmp_path / "quick_start.py"
    path.write_text(code, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", COUNT.format(path=str(path))],
        env={**os.environ, "PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(tmp_path / "empty")},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.endswith("compilations: 0\n")
