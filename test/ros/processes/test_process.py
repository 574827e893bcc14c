# SPDX-License-Identifier: Apache-2.0
"""How a node process treats signals, in this process."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from importlib import import_module

import pytest

from skydiver_utc.nodes.process import StopRequest
from skydiver_utc.parameters.nodes import SETTINGS

pytestmark = pytest.mark.processes


@pytest.fixture
def stop() -> Iterator[StopRequest]:
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield StopRequest()
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_interrupts_the_start_and_a_further_one_does_nothing(
    stop: StopRequest, number: signal.Signals
) -> None:
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(number)
    signal.raise_signal(signal.SIGINT)
    assert stop.requested


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_once_the_node_runs_a_signal_is_only_noted(stop: StopRequest, number: signal.Signals) -> None:
    stop.deferred = True
    signal.raise_signal(number)
    signal.raise_signal(number)
    assert stop.requested


@pytest.mark.parametrize("kind", SETTINGS)
def test_every_node_s_file_has_a_main_that_explains_the_node(
    kind: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], stop: StopRequest
) -> None:
    monkeypatch.setattr(sys, "argv", [f"{kind}_node", "--help"])
    assert import_module(f"skydiver_utc.nodes.{kind}_node").main() == 0
    assert capsys.readouterr().out.startswith(f"usage: {kind}_node")


def test_a_help_text_whose_reader_has_gone_is_no_error() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    code = "from skydiver_utc.nodes.plant_node import main; raise SystemExit(main())"
    command = [sys.executable, "-c", code, "--help"]
    ended = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writer)
    assert (ended.returncode, ended.stderr) == (0, "")
