# SPDX-License-Identifier: Apache-2.0
"""Blocks of a scenario laid over one another."""

from typing import Any


def merged(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    """Fields of `over` laid over those of `base`, block by block."""
    result = dict(base)
    for key, value in over.items():
        old = result.get(key)
        if isinstance(old, dict) and isinstance(value, dict):
            # A block of another kind (a sine for a constant) or with a name (a posture) replaces the old one whole.
            whole = "name" in value or value.get("kind", old.get("kind")) != old.get("kind")
            result[key] = value if whole else merged(old, value)
        else:
            result[key] = value
    return result
