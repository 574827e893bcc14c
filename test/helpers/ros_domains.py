# SPDX-License-Identifier: Apache-2.0
"""A ROS domain for each test, whatever other tests run on this machine at the same time; needs no rclpy.

PYTEST_DONT_REWRITE: tests import names from here before pytest loads it as a plugin.
"""

import fcntl
import os
import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

_DOMAINS = 101
_FIRST_PORT = 7410
_PORTS_PER_DOMAIN = 250


@contextmanager
def reserved_domain() -> Iterator[int]:
    """A domain id that no other test of this machine holds and no node uses."""
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
    start = worker * 13 + os.getpid()
    folder = Path(tempfile.gettempdir()) / f"skydiver_utc_test_domains_{os.getuid()}"
    folder.mkdir(exist_ok=True)
    for domain in ((start + i) % _DOMAINS + 1 for i in range(_DOMAINS)):
        with (folder / str(domain)).open("w") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            if _port_is_free(_FIRST_PORT + _PORTS_PER_DOMAIN * domain):
                yield domain
                return
    pytest.fail("all ROS domains of this machine are in use")


def _port_is_free(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("", port))
        except OSError:
            return False
        return True


@pytest.fixture
def domain() -> Iterator[int]:
    """The domain id of one test."""
    with reserved_domain() as reserved:
        yield reserved
