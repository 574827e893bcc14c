"""How every kernel is compiled and where the result is kept.

Contraction, reassociation and unsigned zeros let the loops over the segments become vector code; NaN and
infinity keep their meaning, so that comparisons with them work (np.isfinite of a sum may be folded away: write
abs(x) < inf). Kernels are inlined into those that call them: otherwise
the order of additions, and with it the last bit, would depend on whether the callee came from the cache.
Numba renews a cached kernel when its own file changes, but not when a kernel that it calls from another file
does; so the cache lies in a folder named after the contents of all rooms that hold kernels or their constants.
"""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba

_Function = TypeVar("_Function", bound=Callable[..., Any])


_ROOMS_WITH_KERNELS = ("plant", "unscented", "control", "simulation")


def _cache_folder() -> str:
    package = Path(__file__).parent
    digest = hashlib.blake2b(Path(__file__).read_bytes(), digest_size=6)
    for room in _ROOMS_WITH_KERNELS:
        for source in sorted((package / room).rglob("*.py")):
            digest.update(source.read_bytes())
    return str(package / "__pycache__" / f"kernels_{digest.hexdigest()}")


_CACHE_FOLDER = _cache_folder()


def kernel(function: _Function) -> _Function:
    """Compile a function without Python objects; where the cache folder cannot be written, numba picks another."""
    settings: Any = numba.config
    configured = settings.CACHE_DIR
    settings.CACHE_DIR = _CACHE_FOLDER
    try:
        compiled: Any = numba.njit(
            cache=True, inline="always", fastmath={"contract", "reassoc", "nsz"}, error_model="numpy"
        )(function)
    finally:
        settings.CACHE_DIR = configured
    result: _Function = compiled
    return result
