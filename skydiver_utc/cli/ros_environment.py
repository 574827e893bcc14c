# SPDX-License-Identifier: Apache-2.0
"""The environment of the nodes of a run."""

import importlib.util
import os
import random
import socket
from collections.abc import Mapping
from pathlib import Path

from skydiver_utc.cli.errors import CommandError

# DDS derives its ports from the domain; above 101 they overlap with the ephemeral ports of Linux.
_DOMAINS = range(1, 102)
_LAST_DOMAIN = 232
_FIRST_DISCOVERY_PORT = 7410
_PORTS_PER_DOMAIN = 250

_WHEELS_BOOTSTRAP = "_ROS_WHEELS_BOOTSTRAP_COMPLETE"


def require_rclpy() -> None:
    """Raise `CommandError` if rclpy is not installed, without importing it."""
    if importlib.util.find_spec("rclpy") is None:
        raise CommandError(
            "this needs rclpy, which is not installed: source a ROS 2 Jazzy environment, install the ros"
            " extra, or run the scenario without ROS by `skydiver-utc simulate`"
        )


def node_environment(base: Mapping[str, str], domain: str = "") -> dict[str, str]:
    """The caller's environment; where it does not set them, discovery on this machine, and `domain` or a free one."""
    from skydiver_utc.nodes import discovery

    environment = _without_bootstrap(base)
    discovery.prepare(environment)
    domain = environment.get("ROS_DOMAIN_ID") or domain or str(free_domain())
    if not (domain.isascii() and domain.isdigit() and int(domain) <= _LAST_DOMAIN):
        raise CommandError(f"ROS_DOMAIN_ID is {domain!r}: it must be a whole number from 0 to {_LAST_DOMAIN}")
    environment["ROS_DOMAIN_ID"] = domain
    return environment


def free_domain() -> int:
    """A domain without nodes on this machine."""
    for domain in random.SystemRandom().sample(_DOMAINS, len(_DOMAINS)):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(("", _FIRST_DISCOVERY_PORT + _PORTS_PER_DOMAIN * domain))
            except OSError:
                continue
            return domain
    raise CommandError("there is no free ROS domain on this machine: end some nodes, or set ROS_DOMAIN_ID")


def _without_bootstrap(base: Mapping[str, str]) -> dict[str, str]:
    """Without the variables of rclpy's wheels: with them another Python would load this one's libraries."""
    environment = dict(base)
    if environment.pop(_WHEELS_BOOTSTRAP, None):
        folders = environment.get("LD_LIBRARY_PATH", "").split(os.pathsep)
        kept = [f for f in folders if f and not (Path(f).name.startswith("ros_") and f.endswith(".libs"))]
        environment["LD_LIBRARY_PATH"] = os.pathsep.join(kept)
    return environment
