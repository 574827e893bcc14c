"""The deadline holds where no Python code can run any more."""

import subprocess
import sys

import pytest

HANG_WITH_PYTHONS_LOCK = """
import ctypes
from skydiver_utc.nodes.exit_deadline import end_in_time
end_in_time({code}, 1)
print("before", flush=True)
ctypes.PyDLL(None).sleep({sleep_s})
print("after", flush=True)
"""


def run(code: int, sleep_s: int) -> tuple[int, list[str]]:
    script = HANG_WITH_PYTHONS_LOCK.format(code=code, sleep_s=sleep_s)
    finished = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=200)
    return finished.returncode, finished.stdout.split()


@pytest.mark.skipif(sys.platform != "linux", reason="needs POSIX timers")
@pytest.mark.parametrize("code", [0, 3])
def test_a_process_that_hangs_ends_with_its_code(code: int) -> None:
    assert run(code, 250) == (code, ["before"])


def test_a_process_that_ends_in_time_is_left_alone() -> None:
    assert run(3, 0) == (0, ["before", "after"])
