"""A virtual skydiver and the Unscented Transform Controller that flies it."""

from typing import Any

__all__ = ["Status", "UnscentedTransformController", "UtcResult"]

_MODULES = {
    "Status": "skydiver_utc.control.protocol",
    "UnscentedTransformController": "skydiver_utc.control.unscented_controller",
    "UtcResult": "skydiver_utc.control.result",
}


def __getattr__(name: str) -> Any:
    """Load the library's names when they are asked for: the command line starts without numba."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_MODULES[name]), name)
