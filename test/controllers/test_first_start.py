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


def quick_start(folder: Path, *without: str) -> str:
    """A file with the README's quick start, less some lines."""
    page = (ROOT / "README.md").read_text(encoding="utf-8")
    code = page.split("```python\n", 1)[1].split("```", 1)[0]
    for line in without:
        assert line in code
        code = code.replace(line, "")
    path = folder / "quick_start.py"
    path.write_text(code, encoding="utf-8")
    return str(path)


def compilations(path: str, **environment: str) -> int:
    """How many functions a new process compiles for it."""
    done = subprocess.run(
        [sys.executable, "-c", COUNT.format(path=path)],
        env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    return int(done.stdout.rpartition("compilations:")[2])


def test_a_plain_plant_compiles_nothing(tmp_path):
    path = quick_start(tmp_path, *PLAIN)
    assert compilations(path, NUMBA_CACHE_DIR=str(tmp_path / "empty")) == 0
