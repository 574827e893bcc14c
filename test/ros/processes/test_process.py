# SPDX-License-Identifier: Apache-2.0
"""How a node process treats signals, in this process."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import nullcontext

import pytest

from skydiver_utc.nodes.process import StopRequest

pytestmark = pytest.mark.processes


@pytest.fixture
def stop() -> Iterator[StopRequest]:
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield StopRequest()
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("further", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("runs", [False, True])
def test_a_signal_interrupts_the_start_is_noted_once_the_node_runs_and_a_further_one_does_nothing(
    stop: StopRequest, number: signal.Signals, further: signal.Signals, runs: bool
) -> None:
    stop.deferred = runs
    with nullcontext() if runs else pytest.raises(KeyboardInterrupt):
        signal.raise_signal(number)
    signal.raise_signal(further)
    assert stop.requested


def test_the_help_of_every_node_needs_neither_rclpy_nor_numba() -> None:
    program = (
        "import sys\n"
        "from skydiver_utc.nodes import process\n"
        "for kind in ('plant', 'reference', 'controller', 'recorder', 'player'):\n"
        "    getattr(process, f'{kind}_node')(['node', '--help'])\n"
        "print({'rclpy', 'numba', 'numpy'} & set(sys.modules), file=sys.stderr)\n"
    )
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert found.stderr == "set()\n"
    assert found.stdout.count("usage: ") == 5


def test_a_help_text_whose_reader_has_gone_is_no_error() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    code = "from skydiver_utc.nodes.process import plant_node; raise SystemExit(plant_node())"
    command = [sys.executable, "-c", code, "--help"]
    ended = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writer)
    assert (ended.returncode, ended.stderr) == (0, "")
