# SPDX-License-Identifier: Apache-2.0
"""Two machines on one: network, host name and shared memory of their own, a lossy link between them; Linux, root.

A machine is a process that waits in namespaces of its own, its programs are started by `nsenter`. Nothing of it
outlasts this process: the namespaces end with that process, which ends with its stdin, and so does the link.
"""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, NamedTuple

LINK = Path(__file__).with_name("lossy_link.py")
ADDRESSES = ("10.77.0.1", "10.77.0.2")
_ECHO_PORT = 4000


class Conditions(NamedTuple):
    """What the link does to a frame: delay and jitter, each way, and the share that is lost."""

    delay_ms: float = 0.0
    jitter_ms: float = 0.0
    loss: float = 0.0
    seed: int = 1

    def __str__(self) -> str:
        return f"{self.delay_ms:g} ± {self.jitter_ms:g} ms, {100 * self.loss:g} %"


class Machine(NamedTuple):
    """One of the two."""

    name: str
    address: str
    pid: int

    def command(self, command: Sequence[str]) -> list[str]:
        """The command line that runs this command there."""
        return [*("nsenter", "-t", str(self.pid), "--net", "--mount", "--uts", "--"), *command]


def why_not() -> str:
    """Why there cannot be two machines here, and what to do; empty where there can."""
    if os.geteuid() != 0:
        return "network namespaces need root"
    for program, package in (("ip", "iproute2"), ("unshare", "util-linux"), ("nsenter", "util-linux")):
        if shutil.which(program) is None:
            return f"there is no `{program}`: apt-get install {package}"
    if not Path("/dev/net/tun").exists():
        return "there is no /dev/net/tun: load the kernel's module tun, or let the container have the device"
    tried = subprocess.run(["unshare", "--net", "--mount", "--uts", "true"], capture_output=True, text=True)
    return f"namespaces are not allowed here: {tried.stderr.strip()}" if tried.returncode else ""


@contextmanager
def two_machines(conditions: Conditions) -> Iterator[tuple[Machine, Machine]]:
    """Two machines, joined by a link under these conditions."""
    devices = tuple(f"utc{os.getpid()}{end}" for end in "ab")
    with ExitStack() as stack:
        arguments = [*devices, *map(str, conditions)]
        stack.enter_context(_waiting([sys.executable, str(LINK), "link", *arguments]))
        machines = []
        for name, address, device in zip(("left", "right"), ADDRESSES, devices, strict=True):
            script = f"mount -t tmpfs tmpfs /dev/shm && hostname {name} && ip link set lo up"
            script += " && echo ready && exec cat"
            holder = stack.enter_context(
                _waiting(["unshare", "--net", "--mount", "--uts", "sh", "-c", script])
            )
            machine = Machine(name, address, holder.pid)
            _run(["ip", "link", "set", device, "netns", str(holder.pid)])
            for line in (
                f"ip address add {address}/24 dev {device}",
                f"ip link set {device} up",
                f"ip route add 224.0.0.0/4 dev {device}",  # where discovery's multicast goes
            ):
                _run(machine.command(line.split()))
            machines.append(machine)
        yield machines[0], machines[1]


def ping(here: Machine, there: Machine, count: int) -> dict[str, Any]:
    """What the link really does to datagrams of an own kind."""
    with _waiting(there.command([sys.executable, str(LINK), "echo", str(_ECHO_PORT)])):
        found = _run(
            here.command([sys.executable, str(LINK), "ping", there.address, str(_ECHO_PORT), str(count)])
        )
    return dict(json.loads(found))


@contextmanager
def _waiting(command: Sequence[str]) -> Iterator["subprocess.Popen[str]"]:
    """A process that says `ready` and ends with its stdin, here or when this process is killed."""
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        if process.stdout.readline() != "ready\n":
            raise RuntimeError(f"{' '.join(command)} did not come up")
        yield process
    finally:
        process.communicate()


def _run(command: Sequence[str]) -> str:
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
