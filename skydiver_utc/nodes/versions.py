# SPDX-License-Identifier: Apache-2.0
"""Versions of the software of a run, for `versions.json` beside its bag."""

import platform
from importlib import metadata

import rclpy

_PACKAGES = ("skydiver_utc", "numpy", "numba", "llvmlite", "pydantic", "PyYAML", "mcap", "rclpy")


def versions() -> dict[str, str]:
    """Versions by name; a package used from a checkout is "not installed"."""
    found = {name: _version(name) for name in _PACKAGES}
    return {
        "python": platform.python_version(),
        "platform": platform.platform(),
        "machine": platform.machine(),
        "rmw": rclpy.get_rmw_implementation_identifier(),
        **found,
    }


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"
