"""The nodes of a run as processes: started together, watched, ended in the order that loses nothing."""

import ctypes
import json
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import FrameType
from typing import IO, Any

import skydiver_utc

Value = str | bool | int | float | list[str]
Parameters = dict[str, Value]
PLANT, REFERENCE, CONTROLLER, RECORDER = "plant", "reference", "controller", "recorder"
PLAYER = "player"
_REPORTING = (PLANT, PLAYER)  # their stdout is JSON lines

# The plant tells how the flight ended while all others listen; the recorder hears everybody's last word.
_ORDER_OF_ENDING = ((PLANT, PLAYER), (CONTROLLER, REFERENCE), (RECORDER,))
_GRACE_S = 15.0
_POLL_S = 0.1
_LAST_LINES = 6

_PR_SET_PDEATHSIG = 1
_LIBC = ctypes.CDLL(None) if sys.platform == "linux" else None

# Not -m, which would look into the current folder first: the nodes are those of this package, wherever one stands.
NODE_CODE = """
import sys
sys.path[:] = [folder for folder in sys.path if folder]
from skydiver_utc.nodes.{kind}_node import main
sys.exit(main())
"""
PACKAGE_FOLDER = str(Path(skydiver_utc.__file__).resolve().parents[1])


class NodeProcesses:
    """The nodes of one skydiver, in its namespace; all have ended when the `with` block is left."""

    def __init__(self, environment: Mapping[str, str], log_folder: Path, namespace: str = "") -> None:
        self._remapping = ["-r", f"__ns:=/{namespace}"] if namespace else []
        found = [PACKAGE_FOLDER, *filter(None, environment.get("PYTHONPATH", "").split(os.pathsep))]
        self._environment = {**environment, "PYTHONPATH": os.pathsep.join(found)}
        self._log_folder = log_folder
        self._processes: dict[str, subprocess.Popen[str]] = {}
        self._lines: queue.Queue[str] = queue.Queue()

    def __enter__(self) -> "NodeProcesses":
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def start(self, kind: str, parameters: Mapping[str, Value]) -> None:
        """Start ``<kind>_node`` with these ROS parameters; what it reports on stdout is kept for `reports`."""
        command = [sys.executable, "-c", NODE_CODE.format(kind=kind), "--ros-args", *self._remapping]
        for name, value in parameters.items():
            command += ["-p", f"{name}:={json.dumps(value)}"]
        with self._log(kind).open("w") as log:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE if kind in _REPORTING else log,
                stderr=log,
                env=self._environment,
                # Ctrl-C in the terminal must reach the nodes one after the other, from here.
                start_new_session=True,
                preexec_fn=partial(_end_with_parent, os.getpid()),
                text=True,
            )
        self._processes[kind] = process
        if process.stdout is not None:
            threading.Thread(target=self._read, args=(process.stdout,), daemon=True).start()

    def send(self, kind: str, number: signal.Signals) -> None:
        """Send a signal to a node that still runs."""
        if self._processes[kind].poll() is None:
            self._processes[kind].send_signal(number)

    def reports(self) -> Iterator[dict[str, Any]]:
        """What was reported since the last call, after a short wait."""
        try:
            yield from _parsed(self._lines.get(timeout=_POLL_S))
            while True:
                yield from _parsed(self._lines.get_nowait())
        except queue.Empty:
            return

    def pids(self) -> dict[str, int]:
        """The process of each node."""
        return {kind: process.pid for kind, process in self._processes.items()}

    def ended(self, kind: str) -> bool:
        """True when this node's process has ended and all that it printed has been read."""
        return self._processes[kind].poll() is not None and self._lines.empty()

    def failed(self, *apart_from: str) -> str | None:
        """A node, other than the plant and those named, that has ended with an error; None while all is well."""
        others = (PLANT, *apart_from)
        codes = {kind: process.poll() for kind, process in self._processes.items() if kind not in others}
        return next((kind for kind, code in codes.items() if code), None)

    def ending(self, kind: str) -> str:
        """How a node ended, in two words."""
        code = self._processes[kind].wait()
        return f"exit code {code}" if code >= 0 else f"signal {signal.Signals(-code).name}"

    def has_said(self, kind: str, text: str) -> bool:
        """True when a node has written this to its log."""
        return text in self._log(kind).read_text(encoding="utf-8", errors="replace")

    def last_lines(self, kind: str) -> str:
        """What a node wrote to stderr last, indented; empty if it wrote nothing."""
        lines = self._log(kind).read_text(encoding="utf-8", errors="replace").strip().splitlines()
        return "".join(f"\n    {line}" for line in lines[-_LAST_LINES:])

    def end(self) -> None:
        """Interrupt what still runs, in order, and wait; what does not end in time is killed."""
        for kinds in _ORDER_OF_ENDING:
            running = [self._processes[kind] for kind in kinds if kind in self._processes]
            for process in running:
                if process.poll() is None:
                    process.send_signal(signal.SIGINT)
            deadline = time.monotonic() + _GRACE_S
            for process in running:
                _wait(process, deadline)

    def _log(self, kind: str) -> Path:
        return self._log_folder / f"{kind}.log"

    def _read(self, stream: IO[str]) -> None:
        with stream:
            for line in stream:
                self._lines.put(line)


@contextmanager
def interruptible() -> Iterator[None]:
    """Let SIGINT, SIGTERM and SIGHUP raise KeyboardInterrupt, once: nothing cuts the cleaning up short."""
    heard = False

    def interrupt(_number: int, _frame: FrameType | None) -> None:
        nonlocal heard
        if not heard:
            heard = True
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


def _end_with_parent(parent: int) -> None:
    """In the child: be interrupted when the parent is gone, even if it was killed."""
    if _LIBC is not None:
        _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGINT)
        if os.getppid() != parent:
            os.kill(os.getpid(), signal.SIGINT)


def _wait(process: "subprocess.Popen[str]", deadline: float) -> None:
    try:
        process.wait(max(0.0, deadline - time.monotonic()))
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _parsed(line: str) -> Iterator[dict[str, Any]]:
    """The line's JSON object; log lines that went to stdout are no reports."""
    try:
        report = json.loads(line)
    except ValueError:
        return
    if isinstance(report, dict):
        yield report
