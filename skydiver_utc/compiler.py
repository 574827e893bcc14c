# SPDX-License-Identifier: Apache-2.0
"""How numba compiles the kernels and programs of `skydiver_utc.jit`: in less time than by its defaults.

Numba makes machine code of each function that another one calls, too, and optimises each piece of code three times.
Kernels end up inside programs: here these alone are optimised, once, and become machine code.
"""

from functools import lru_cache
from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, Flags


class _Code(JITCodeLibrary):  # type: ignore[misc]
    """Code that LLVM optimises once; numba does so twice, for the counts of references between its passes."""

    def _optimize_functions(self, module: Any) -> None:
        module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self) -> None:
        passes, builder = self._codegen._module_pass_manager()
        passes.run(self._final_module, builder)


class _CodeToInline(_Code):
    """Code of a kernel, which LLVM optimises and makes machine code of inside the programs that call it."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


class _SharedFlags(Flags):  # type: ignore[misc]
    """Options of compilations, equal to themselves only, so that numba finds them fast at each operator."""

    __hash__, __eq__ = object.__hash__, object.__eq__


_shared = lru_cache(_SharedFlags)


class _Flags(Flags):  # type: ignore[misc]
    """Options of one compilation, which numba changes; a copy is for looking up."""

    def copy(self) -> Any:
        """The same object for the same options."""
        return _shared(self)


class ProgramCompiler(Compiler):  # type: ignore[misc]
    """Compiles a function to machine code."""

    def __init__(
        self, typing: Any, target: Any, _library: None, args: Any, result: Any, flags: Any, names: Any
    ) -> None:
        code = _Code(target.codegen(), "program")
        code.enable_object_caching()
        super().__init__(typing, target, code, args, result, _Flags(flags), names)


class KernelCompiler(Compiler):  # type: ignore[misc]
    """Compiles a function to code that is inlined."""

    def __init__(
        self, typing: Any, target: Any, _library: None, args: Any, result: Any, flags: Any, names: Any
    ) -> None:
        flags.no_compile = True
        code = _CodeToInline(target.codegen(), "kernel")
        super().__init__(typing, target, code, args, result, _Flags(flags), names)
