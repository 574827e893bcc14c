# SPDX-License-Identifier: Apache-2.0
"""Compiling kernels, calling them by address, and keeping them on disk.

A `kernel` is compiled into those that call it. A `program` is what Python calls, or another program through its
`address`: it alone is kept on disk, so what it computes never depends, to the last bit, on what came from there.
The model that a controller predicts with is called by address: a controller's program is the same for all of them.

Numba counts references to arrays in functions of users and in `allocating` kernels only; others make no arrays.
Contraction, reassociation and unsigned zeros let loops over segments become vector code; NaN and infinity keep their
meaning in comparisons (np.isfinite of a sum may be folded away: write abs(x) < inf).
Numba renews a program when its own file changes, but not when a kernel from another file does; so the package's
programs lie in a folder named after the contents of all rooms that hold kernels. A user's own lie where numba puts
them, beside the file or in NUMBA_CACHE_DIR, under a digest of all that they refer to. Where no folder can be written,
nothing is kept.
"""

import hashlib
import importlib
import marshal
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cached_property, lru_cache, partial
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any, TypeVar

import numba
import numpy as np
from numba.core import cgutils, event, types
from numba.core.caching import FunctionCache, NullCache
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher
from numba.core.errors import TypingError
from numba.core.registry import CPUDispatcher
from numba.core.serialize import dumps
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, intrinsic, lower_getattr_generic

from skydiver_utc.compiler import KernelCompiler, ProgramCompiler

_Function = TypeVar("_Function", bound=Callable[..., Any])

_types: Any = types  # Numba's types are made when it is imported.
_OPTIONS: Any = {
    "fastmath": {"contract", "reassoc", "nsz"},
    "error_model": "numpy",
    "no_cfunc_wrapper": True,
}
_ROOMS_WITH_KERNELS = ("plants", "unscented", "controllers", "estimators", "disturbances")


class _Blas(ModuleType):
    """In the place of SciPy's BLAS, which numba looks for at each start, until machine code asks for a routine.

    Its import brings all of scipy.linalg, a tenth of the time of a start; kernels of this package use no BLAS.
    """

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") and name != "__pyx_capi__":
            raise AttributeError(name)
        sys.modules.pop(self.__name__, None)
        return getattr(importlib.import_module(self.__name__), name)


sys.modules.setdefault("scipy.linalg.cython_blas", _Blas("scipy.linalg.cython_blas"))


def kernel(function: _Function) -> _Function:
    """Compile a function into the kernels and programs that call it; Python runs it as a program of its own."""
    return _kernel(function)


def inlined(function: _Function) -> _Function:
    """A kernel of a hot loop, inlined into its callers."""
    return _kernel(function, inline="always")


def allocating(function: _Function) -> _Function:
    """A kernel that makes arrays, inlined into its callers."""
    return _kernel(function, inline="always", _nrt=True)


def _kernel(function: _Function, **options: Any) -> _Function:
    compiled: Any = _Kernel(
        function,
        pipeline_class=KernelCompiler,
        targetoptions={
            "nopython": True,
            "no_cpython_wrapper": True,
            "forceinline": True,
            "_nrt": not _is_own(function),
            **_OPTIONS,
            **options,
        },
    )
    result: _Function = compiled
    return result


def unfused(function: _Function) -> _Function:
    """A program that rounds each operation as Python does."""
    return program(function, fastmath=False)


def program(function: _Function, **options: Any) -> _Function:
    """Compile a function that Python calls, or another program by its `address`, and keep it on disk."""
    settings: Any = numba.config
    options = {"_nrt": not _is_own(function), **_OPTIONS, **options}
    with global_compiler_lock:
        configured = settings.CACHE_DIR
        settings.CACHE_DIR = str(
            Path(configured or Path(__file__).parent / "__pycache__") / _sources_digest()
        )
        try:
            compiled: Any = kept_on_disk(
                numba.njit(pipeline_class=ProgramCompiler, **options)(function), function
            )
        finally:
            settings.CACHE_DIR = configured
    result: _Function = compiled
    return result


def kept_on_disk(compiled: Any, source: Callable[..., Any]) -> Any:
    """Keep what a jitted function, made of `source`, compiles to, if there is a folder that can be written."""
    # Numba finds no folder that it can write, or the function stands in no file.
    with suppress(RuntimeError, OSError):
        counts_references = compiled.targetoptions.get("_nrt", True)
        compiled._cache = _Cache(compiled.py_func, source, counts_references)
    return compiled


def is_jitted(function: object) -> bool:
    """Whether numba can call the function from compiled code."""
    return isinstance(function, Dispatcher)


def interpreted(compiled: Any, **names: Any) -> Any:
    """A function, jitted or not, as plain Python, with other objects under some names of its module.

    So are the kernels that it calls: nothing is compiled for a plant of plain Python.
    """
    function = getattr(compiled, "py_func", compiled)
    known = function.__globals__
    called = {name: known[name] for name in _names(function.__code__) if name in known}
    kernels = {name: interpreted(value) for name, value in called.items() if isinstance(value, _Kernel)}
    return FunctionType(function.__code__, {**known, **kernels, **names}, function.__name__)


def keep(given: Any) -> None:
    """Keep a user's jitted function on disk, if it is not kept already."""
    if is_jitted(given) and isinstance(given._cache, NullCache):
        kept_on_disk(given, given)


def bound(template: Any, name: str, owner: Any, **names: Any) -> Any:
    """A plain function from a template of module level, compiled and kept on disk as if it stood beside `owner`.

    `names` are what the template's globals of these names are; `owner` is the jitted function of the user's among them.
    """
    plain = owner.py_func
    code = template.__code__.replace(
        co_filename=plain.__code__.co_filename, co_firstlineno=plain.__code__.co_firstlineno
    )
    function = FunctionType(code, {**template.__globals__, **names}, name)
    function.__module__, function.__qualname__ = plain.__module__, f"{plain.__qualname__}.{template.__name__}"
    if _is_own(plain):
        return program(function, _nrt=owner.targetoptions.get("_nrt", True))
    return kept_on_disk(numba.njit(error_model="numpy", no_cfunc_wrapper=True)(function), owner)


class InMemory:
    """Numbers of a model in memory, where machine code finds them by their address: tuples of numbers and arrays.

    Raises ValueError for anything else among them.
    """

    def __init__(self, numbers: Any) -> None:
        self._kept = _plain_numbers(numbers)
        self._layout = np.array(_layout(self._kept), dtype=np.int64)
        self.address = self._layout.ctypes.data
        self.type = _types.CPointer(numba.typeof(self._kept))


def _plain_numbers(value: Any) -> Any:
    """The same with floats and integers of one size."""
    if isinstance(value, tuple):
        items = [_plain_numbers(item) for item in value]
        return type(value)(*items) if hasattr(value, "_fields") else tuple(items)
    if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
        return value
    if isinstance(value, bool | np.bool_ | int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value)
    raise ValueError(
        f"the numbers of a model are numbers, arrays and tuples of such, not {type(value).__name__}"
    )


def _layout(value: Any) -> list[int]:
    """The words of 8 bytes in which numba stores a value; of an array its address, shape and strides."""
    if isinstance(value, tuple):
        return [word for item in value for word in _layout(item)]
    if isinstance(value, np.ndarray):
        # The first two words, numba's owner of the memory, are null: no reference counting.
        return [0, 0, value.size, value.itemsize, value.ctypes.data, *value.shape, *value.strides]
    return [value if isinstance(value, int) else int(np.float64(value).view(np.int64))]


def by_address(parts: Sequence[tuple[Any, Any]], *example: Any) -> Callable[..., None]:
    """Jitted functions (..., numbers, out), each with its own numbers in memory, one after the other in one call.

    example: arguments without the numbers, up to three and out; those of a call must be C-contiguous and of these types
    """
    placed = [InMemory(numbers) for _, numbers in parts]
    functions = [
        address(function, *example[:-1], numbers, example[-1])
        for (function, _), numbers in zip(parts, placed, strict=True)
    ]
    where = np.array([functions, [numbers.address for numbers in placed]])
    run = _Call((_run_one, _run_two, _run_three)[len(example) - 2], where)
    run.kept = parts, placed  # Machine code and numbers live as long as what calls them.
    return run


class _Call(partial[None]):
    """A call by address, which holds in this process only."""

    kept: Any

    def __reduce__(self) -> Any:
        raise TypeError("machine code cannot be sent to another process")


def address(function: Any, *example: Any) -> int:
    """The address of the machine code of a jitted function for such arguments; it must return nothing.

    An argument `InMemory` is handed over by its address; the function reads its fields, or its `contents`.
    """
    function = getattr(function, "as_program", function)
    given = (value.type if isinstance(value, InMemory) else numba.typeof(value) for value in example)
    compiled = function.get_compile_result(numba.core.typing.signature(types.none, *given))
    return int(compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name))


def in_memory(given: Any) -> Any:
    """A jitted function (..., numbers, out) that finds its numbers in memory; it lives as long as the given one."""
    if not hasattr(given, "in_memory"):
        template = {3: _of_three, 4: _of_four}[given.py_func.__code__.co_argcount]
        given.in_memory = bound(template, "in_memory", given, function=given)
    return given.in_memory


def function(*_: Any) -> Any:
    """The function that the templates below call."""


def _of_three(first: Any, numbers: Any, out: Any) -> None:
    function(first, contents(numbers), out)


def _of_four(first: Any, second: Any, numbers: Any, out: Any) -> None:
    function(first, second, contents(numbers), out)


@intrinsic  # type: ignore[untyped-decorator]
def contents(_context: Any, pointer: Any) -> Any:
    """The value at a pointer, part by part, without reference counting."""

    def generate(context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        return _load(context, builder, pointer.dtype, values[0])

    return pointer.dtype(pointer), generate


def _load(context: Any, builder: Any, kind: Any, where: Any) -> Any:
    if isinstance(kind, _types.BaseTuple):
        places = (cgutils.gep_inbounds(builder, where, 0, i) for i in range(len(kind)))
        parts = [_load(context, builder, *each) for each in zip(kind.types, places, strict=True)]
        return context.make_tuple(builder, kind, parts)
    value = context.data_model_manager[kind].load_from_data_pointer(builder, where)
    if isinstance(kind, types.Array):
        array = context.make_array(kind)(context, builder, value=value)
        array.meminfo = cgutils.get_null_value(array.meminfo.type)
        array.parent = cgutils.get_null_value(array.parent.type)
        return array._getvalue()
    return value


@infer_getattr  # type: ignore[untyped-decorator]
class _Fields(AttributeTemplate):  # type: ignore[misc]
    """pointer.name: a field of a named tuple in memory, which alone is loaded."""

    key = _types.CPointer

    def generic_resolve(self, pointer: Any, name: str) -> Any:
        kind = pointer.dtype
        return kind.types[kind.fields.index(name)] if name in getattr(kind, "fields", ()) else None


@lower_getattr_generic(_types.CPointer)  # type: ignore[untyped-decorator]
def _field(context: Any, builder: Any, pointer: Any, value: Any, name: str) -> Any:
    i = pointer.dtype.fields.index(name)
    return _load(context, builder, pointer.dtype.types[i], cgutils.gep_inbounds(builder, value, 0, i))


@intrinsic  # type: ignore[untyped-decorator]
def call(_context: Any, where: Any, arguments: Any) -> Any:
    """call(address, (argument, ...)): run the machine code there; what it raises is raised here."""
    for kind in arguments:
        if isinstance(kind, types.Array) and (kind.layout != "C" or kind.dtype != types.float64):
            raise TypingError(f"machine code takes contiguous arrays of float64, not {kind}")

    def generate(context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        convention, given = context.call_conv, tuple(arguments)
        pointer = builder.inttoptr(values[0], convention.get_function_type(types.none, given).as_pointer())
        unpacked = cgutils.unpack_tuple(builder, values[1], len(given))
        status, _ = convention.call_function(builder, pointer, types.none, given, unpacked)
        with cgutils.if_unlikely(builder, status.is_error):
            convention.return_status_propagate(builder, status)
        return context.get_dummy_value()

    return types.none(where, arguments), generate


class _Kernel(CPUDispatcher):  # type: ignore[misc]
    """A function for compiled code; a call from Python goes to a program that is kept on disk."""

    @cached_property
    def as_program(self) -> Any:
        return program(self.py_func, _nrt=self.targetoptions["_nrt"])

    def add_overload(self, compiled: Any) -> None:
        """Register a compilation, which has no machine code, with what stands for it in calls."""
        entry = object()
        compiled.target_context.insert_user_function(entry, compiled.fndesc, [compiled.library])
        self.overloads[tuple(compiled.signature.args)] = compiled._replace(entry_point=entry)

    def __call__(self, *arguments: Any) -> Any:
        return self.as_program(*arguments)


class _Cache(FunctionCache):  # type: ignore[misc]
    """Numba's cache, but for a folder that cannot be written any more, and for what a user's function refers to."""

    def __init__(self, py_func: Any, source: Callable[..., Any], counts_references: bool) -> None:
        super().__init__(py_func)
        self._source, self._counts_references = source, counts_references

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The compilation kept for a signature, or None."""
        with suppress(_UnknownContentsError):
            if self._counts_references:
                return super().load_overload(sig, target_context)
            # Without numba's implementations of functions, whose import takes longer than a flight.
            with self._guard_against_spurious_io_errors():
                return self._load_overload(sig, target_context)
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Write a compilation, if possible."""
        with suppress(OSError, _UnknownContentsError):
            super().save_overload(sig, data)

    def _index_key(self, sig: Any, codegen: Any) -> tuple[Any, ...]:
        return (*super()._index_key(sig, codegen), _sources_digest(), _contents(self._source))


class _UnknownContentsError(Exception):
    """A function refers to an object without a digest."""


def _contents(source: Any) -> str:
    """Digest of a user's function, and of all that it refers to: closures, globals, functions that it calls.

    Empty for functions of this package, whose folder is named after its contents.
    """
    waiting: list[Any] = [source]
    digest, seen = hashlib.blake2b(digest_size=16), set()
    while waiting:
        value = waiting.pop()
        plain = getattr(value, "py_func", value)
        if isinstance(plain, FunctionType):
            if _is_own(plain) or id(plain) in seen:
                continue
            seen.add(id(plain))
            digest.update(marshal.dumps(plain.__code__, 2))  # later versions depend on reference counts
            waiting += [cell.cell_contents for cell in plain.__closure__ or ()]
            waiting += [plain.__globals__[n] for n in _names(plain.__code__) if n in plain.__globals__]
        elif isinstance(value, ModuleType):
            file = Path(getattr(value, "__file__", None) or "")
            digest.update(f"{value.__name__} {file.stat().st_mtime_ns if file.is_file() else 0}".encode())
        else:
            try:
                digest.update(dumps(value))
            except Exception as error:
                raise _UnknownContentsError from error
    return digest.hexdigest() if seen else ""


def _is_own(function: Callable[..., Any]) -> bool:
    return (function.__module__ or "").partition(".")[0] == __package__


def _names(code: CodeType) -> list[str]:
    """Names that a function's code and the functions inside it look up."""
    inner = [name for part in code.co_consts if isinstance(part, CodeType) for name in _names(part)]
    return [*code.co_names, *inner]


@lru_cache(maxsize=1)
def _sources_digest() -> str:
    package = Path(__file__).parent
    digest = hashlib.blake2b(Path(__file__).read_bytes(), digest_size=6)
    for module in ("compiler.py", "rotations.py"):
        digest.update((package / module).read_bytes())
    for room in _ROOMS_WITH_KERNELS:
        for source in sorted((package / room).rglob("*.py")):
            digest.update(source.read_bytes())
    return f"kernels_{digest.hexdigest()}"


class _Once(event.Listener):  # type: ignore[misc]
    def __init__(self, report: Callable[[str], object]) -> None:
        self._report: Callable[[str], object] | None = report

    def on_start(self, event: Any) -> None:
        report, self._report = self._report, None
        if report is not None:
            report("compiling for the first use; later starts take it from disk")

    def on_end(self, event: Any) -> None:
        pass


def on_first_compilation(report: Callable[[str], object]) -> None:
    """Pass a sentence on, once, when the first function of this process is compiled rather than loaded."""
    event.register("numba:compile", _Once(report))


@program
def _run_one(parts: Any, first: Any, out: Any) -> None:
    for i in range(parts.shape[1]):
        call(parts[0, i], (first, parts[1, i], out))


@program
def _run_two(parts: Any, first: Any, second: Any, out: Any) -> None:
    for i in range(parts.shape[1]):
        call(parts[0, i], (first, second, parts[1, i], out))


@program
def _run_three(parts: Any, first: Any, second: Any, third: Any, out: Any) -> None:
    for i in range(parts.shape[1]):
        call(parts[0, i], (first, second, third, parts[1, i], out))
