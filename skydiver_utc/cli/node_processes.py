# SPDX-License-Identifier: Apache-2.0
"""Nodes as processes: started together, watched, and ended in an order that loses no message."""

import json
import os
import queue
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import IO, Any

import skydiver_utc

Value = str | bool | int | float | list[str]
Parameters = dict[str, Value]
PLANT, REFERENCE, ESTIMATOR, CONTROLLER = "plant", "reference", "estimator", "controller"
RECORDER, PLAYER = "recorder", "player"

# The plant publishes the outcome while all others still subscribe; the recorder ends after every publisher.
_ORDER_OF_ENDING = ((PLANT, PLAYER), (CONTROLLER, ESTIMATOR, REFERENCE), (RECORDER,))
_GRACE_S = 15.0
_POLL_S = 0.1
_LAST_LINES = 6

# With -m, Python would first look for modules in the current folder.
NODE_CODE = """
import sys
sys.path[:] = [folder for folder in sys.path if folder]
from skydiver_utc.nodes.process import {kind}_node
sys.exit({kind}_node())
"""
PACKAGE_FOLDER = str(Path(skydiver_utc.__file__).resolve().parents[1])


class NodeProcesses(AbstractContextManager["NodeProcesses"]):
    """The nodes of one run; all end with the `with` block. `module_folder` is added to their Python path."""

    def __init__(
        self,
        environment: Mapping[str, str],
        log_folder: Path,
        namespace: str = "",
        own_clock: bool = False,
        module_folder: Path | None = None,
    ) -> None:
        self._remapping = ["-r", f"__ns:=/{namespace}"] if namespace else []
        if own_clock:
            self._remapping += ["-r", f"/clock:=/{namespace}/clock", "-r", f"/tf:=/{namespace}/tf"]
        path = [PACKAGE_FOLDER, environment.get("PYTHONPATH", ""), str(module_folder or "")]
        self._environment = {**environment, "PYTHONPATH": os.pathsep.join(filter(None, path))}
        self._log_folder = log_folder
        self._processes: dict[str, subprocess.Popen[str]] = {}
        self._lines: queue.Queue[str] = queue.Queue()

    def __exit__(self, *_: object) -> None:
        self.end()

    def start(self, kind: str, parameters: Mapping[str, Value], prefix: Sequence[str] = ()) -> None:
        """Start ``<kind>_node``, its command line after `prefix`; the plant's JSON lines on stdout go to `reports`."""
        # The kernel interrupts a node when this process is gone, even killed; not outside Linux.
        setpriv = shutil.which("setpriv")
        command = [*prefix, *([setpriv, "--pdeathsig", "INT", "--"] if setpriv else [])]
        command += [sys.executable, "-c", NODE_CODE.format(kind=kind), "--ros-args", *self._remapping]
        for name, value in parameters.items():
            command += ["-p", f"{name}:={json.dumps(value)}"]
        with self._log(kind).open("w") as log:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE if kind == PLANT else log,
                stderr=log,
                env=self._environment,
                start_new_session=True,  # Ctrl-C in the terminal reaches only this process, which ends the nodes
                text=True,
            )
        self._processes[kind] = process
        if process.stdout is not None:
            threading.Thread(target=self._read, args=(process.stdout,), daemon=True).start()

    def reports(self) -> Iterator[dict[str, Any]]:
        """The plant's reports since the last call; waits for a moment."""
        try:
            yield from _parsed(self._lines.get(timeout=_POLL_S))
            while True:
                yield from _parsed(self._lines.get_nowait())
        except queue.Empty:
            return

    def ended(self, kind: str) -> bool:
        """True when the process has ended and `reports` has returned all of its reports."""
        return self._processes[kind].poll() is not None and self._lines.empty()

    def failed(self, *apart_from: str) -> str | None:
        """A node, other than the plant and those given, that has ended with an error; None if there is none."""
        others = (PLANT, *apart_from)
        codes = {kind: process.poll() for kind, process in self._processes.items() if kind not in others}
        return next((kind for kind, code in codes.items() if code), None)

    def exit_code(self, kind: str) -> int:
        """The exit code of a node, once it has ended; -N after signal N."""
        return self._processes[kind].wait()

    def ending(self, kind: str) -> str:
        """The end of a node in two words."""
        code = self.exit_code(kind)
        return f"exit code {code}" if code >= 0 else f"signal {signal.Signals(-code).name}"

    def last_lines(self, kind: str) -> Sequence[str]:
        """The last lines of a node's log."""
        text = self._log(kind).read_text(encoding="utf-8", errors="replace")
        return text.strip().splitlines()[-_LAST_LINES:]

    def end(self) -> None:
        """Interrupt the nodes in order and wait for them; those still running after the grace time are killed."""
        for kinds in _ORDER_OF_ENDING:
            running = [self._processes[kind] for kind in kinds if kind in self._processes]
            for process in running:
                process.send_signal(signal.SIGINT)
            deadline = time.monotonic() + _GRACE_S
            for process in running:
                try:
                    process.wait(max(0.0, deadline - time.monotonic()))
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()

    def _log(self, kind: str) -> Path:
        return self._log_folder / f"{kind}.log"

    def _read(self, stream: IO[str]) -> None:
        with stream:
            for line in stream:
                self._lines.put(line)


@contextmanager
def interruptible() -> Iterator[None]:
    """Let the first SIGINT, SIGTERM or SIGHUP raise KeyboardInterrupt; further ones do not disturb the cleanup."""
    interrupted = False

    def interrupt(_number: int, _frame: FrameType | None) -> None:
        nonlocal interrupted
        if not interrupted:
            interrupted = True
            raise KeyboardInterrupt

    numbers = [signal.SIGINT, signal.SIGTERM]
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        numbers.append(signal.SIGHUP)
    before = {number: signal.signal(number, interrupt) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _parsed(line: str) -> Iterator[dict[str, Any]]:
    """The report in a line; other output is ignored."""
    with suppress(ValueError):
        report = json.loads(line)
        if isinstance(report, dict):
            yield report
