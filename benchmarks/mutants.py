# SPDX-License-Identifier: Apache-2.0
"""Whether the tests see faults: the core with one operator, number or statement changed, its tests run each time.

    python benchmarks/mutants.py --count 48 --seed 1

A mutant survives if the tests of its room that call its function pass. The checkout stays as it is.
Annotations and the fields of settings classes are left out: their numbers are data. So are the keywords of `zip` and
`lru_cache` and the arguments of `np.empty`: `strict` is an assertion, and larger caches and scratch change no result.
"""

import ast
import copy
import importlib
import linecache
import multiprocessing
import os
import random
import resource
import sys
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from importlib.machinery import SourceFileLoader
from multiprocessing.connection import Connection, wait
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any, NamedTuple

import click
import hypothesis  # noqa: F401
import matplotlib.figure  # noqa: F401
import mcap.writer  # noqa: F401
import numba  # noqa: F401
import pydantic  # noqa: F401
import pytest
import rosbags.rosbag2  # noqa: F401
import scipy.optimize  # noqa: F401

ROOT = Path(__file__).resolve().parents[1]
# Room -> the tests for its mutants.
TESTS = {
    "unscented": "unscented/*.py controllers/test_utc_against_paper.py",
    "controllers/utc": "controllers/test_u*.py",
    "plants/skydiver": "plants/*.py body/test_movement.py estimators/test_sensors.py",
    "recording": "recording/*.py analysis/test_recorded_run.py cli/test_field.py",
    "parameters": (
        "parameters/*.py messages/*.py body/*.py theory/test_stability.py recording/test_writer.py"
        " cli/test_run_plans.py cli/test_written_files.py cli/test_cli.py"
    ),
    "references": "references/*.py",
}
# A mutant whose tests hang, or take all memory, is seen.
LONGEST_S, LONGEST_TEST_S = 900.0, 120.0
LARGEST_BYTES = 2**32
_PAIRS = "Add Sub, Mult Div, Lt LtE, Gt GtE, Eq NotEq, Is IsNot, In NotIn, And Or"
_SWAPS: dict[type, type] = dict.fromkeys((ast.FloorDiv, ast.Mod, ast.Pow), ast.Mult)
for one, other in (pair.split() for pair in _PAIRS.split(", ")):
    _SWAPS |= {getattr(ast, one): getattr(ast, other), getattr(ast, other): getattr(ast, one)}


class Mutant(NamedTuple):
    """A file with one attribute of one node changed."""

    room: str
    file: str
    tree: ast.Module
    node: Any
    attribute: str
    new: Any
    function: int  # first line of the function around the node; 0: in none

    def shown(self) -> str:
        changed = copy.copy(self.node)
        setattr(changed, self.attribute, self.new)
        place = f"{Path(self.file).relative_to(ROOT)}:{self.node.lineno}"
        line = linecache.getline(self.file, self.node.lineno).strip()
        return f"{place}: {ast.unparse(self.node)} -> {ast.unparse(changed)} in: {line}"

    def compiled(self) -> CodeType:
        """The changed file; only for a process of its own, since it changes the tree."""
        setattr(self.node, self.attribute, self.new)
        return compile(ast.fix_missing_locations(self.tree), self.file, "exec", dont_inherit=True)


def mutants_of(room: str, file: Path) -> list[Mutant]:
    """All mutants of a file."""
    tree = ast.parse(file.read_bytes())
    return [
        Mutant(room, str(file), tree, node, attribute, new, function)
        for node, function in _code(tree)
        for attribute, new in _changes(node)
    ]


def _changes(node: ast.AST) -> Iterator[tuple[str, Any]]:
    """Attributes of a node, and what they are changed to."""
    match node:
        case ast.BinOp(op=op) | ast.AugAssign(op=op) | ast.BoolOp(op=op) if type(op) in _SWAPS:
            yield "op", _SWAPS[type(op)]()
        case ast.Compare(ops=[op]):
            yield "ops", [_SWAPS[type(op)]()]
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            yield "operand", ast.UnaryOp(ast.Not(), operand)
        case ast.Constant(value=bool(value)):
            yield "value", not value
        case ast.Constant(value=int(value) | float(value)):
            yield "value", value + 1 if value + 1 != value else 2 * value
        case ast.Raise() | ast.Expr(value=ast.Call()):
            yield "__class__", ast.Pass


def _code(node: ast.AST, function: int = 0) -> Iterator[tuple[ast.AST, int]]:
    """The nodes below one, but for what is left out (see above), each with the first line of its function."""
    left_out = ["annotation", "returns", "decorator_list"]
    if isinstance(node, ast.Call):
        left_out += {"zip": ["keywords"], "lru_cache": ["keywords"], "np.empty": ["args"]}.get(
            ast.unparse(node.func), []
        )
    for name, value in ast.iter_fields(node):
        if name in left_out:
            continue
        if isinstance(node, ast.FunctionDef) and name == "body":
            function = min(part.lineno for part in [node, *node.decorator_list])
        for child in value if isinstance(value, list) else [value]:
            field = isinstance(node, ast.ClassDef) and isinstance(child, ast.AnnAssign)
            bounds = isinstance(child, ast.Subscript) and getattr(child.value, "id", "") == "Annotated"
            if isinstance(child, ast.AST) and not field and not bounds:
                yield child, function
                yield from _code(child, function)


class Ran(NamedTuple):
    """Tests run in a process of their own, which had the libraries, and nothing of the package, imported."""

    passed: bool
    seconds: float
    called: set[tuple[str, int]]  # functions that ran: file and first line; line 0: the file was imported


def run(tests: Iterable[Path], mutant: Mutant | None = None) -> Ran:
    """Run tests on a mutant until one fails, or without any to note which functions run."""
    began = time.monotonic()
    answer, sender = multiprocessing.Pipe(duplex=False)
    arguments = list(map(str, tests)), mutant, sender
    process = multiprocessing.get_context("fork").Process(target=_test, args=arguments)
    process.start()
    wait([answer, process.sentinel], LONGEST_S)
    passed, called = answer.recv() if answer.poll() else (False, set())
    process.kill()
    process.join()
    return Ran(passed, time.monotonic() - began, called)


def _test(tests: list[str], mutant: Mutant | None, answer: Connection) -> None:
    called: set[tuple[str, int]] = set()
    sys.path.insert(0, str(ROOT))
    sys.dont_write_bytecode = True
    resource.setrlimit(resource.RLIMIT_DATA, (LARGEST_BYTES, LARGEST_BYTES))
    for stream in (1, 2):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
    if mutant is not None:
        _import_mutated(mutant)
    _compile_mutated(mutant, called)
    with tempfile.TemporaryDirectory() as folder:
        os.environ["HYPOTHESIS_STORAGE_DIRECTORY"] = folder
        options = ["-q", "-x", "-n", "0", "-p", "no:cacheprovider", "-m", "not long and not processes"]
        options += ["-o", f"faulthandler_timeout={LONGEST_TEST_S}"]
        code = pytest.main([*options, *tests], plugins=[_Traced(called)] if mutant is None else [])
    sys.settrace(None)
    answer.send((code in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED), called))
    os._exit(0)


class _Traced:
    """Notes the functions that tests call; set anew for each, since what a test raises in it ends the tracing."""

    def __init__(self, called: set[tuple[str, int]]) -> None:
        self._called = called
        self.pytest_runtest_setup()  # for what the collection imports and calls

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup(self) -> None:
        for trace in (threading.settrace, sys.settrace):
            trace(lambda frame, *_: self._called.add(_place(frame.f_code)))


def _place(code: CodeType) -> tuple[str, int]:
    return code.co_filename, 0 if code.co_name == "<module>" else code.co_firstlineno


def _import_mutated(mutant: Mutant) -> None:
    code, unchanged = mutant.compiled(), SourceFileLoader.get_code

    def get_code(loader: SourceFileLoader, name: str) -> CodeType | None:
        return code if loader.path == mutant.file else unchanged(loader, name)

    SourceFileLoader.get_code = get_code


def _compile_mutated(mutant: Mutant | None, called: set[tuple[str, int]]) -> None:
    """Have programs that call a mutated kernel compiled, all others loaded from the disk; note their functions."""
    jit = importlib.import_module("skydiver_utc.jit")
    load = jit._Cache.load_overload

    def load_overload(cache: Any, *arguments: Any) -> Any:
        codes, waiting = set(), [cache._source]
        while waiting:
            known = waiting.pop()
            function = getattr(known, "py_func", known)
            if isinstance(function, FunctionType) and function.__code__ not in codes:
                codes.add(function.__code__)
                known = function.__globals__
                waiting += [known[name] for name in jit._names(function.__code__) if name in known]
        places = set(map(_place, codes))
        called.update(places)
        anew = mutant is not None and (not mutant.function or (mutant.file, mutant.function) in places)
        return None if anew else load(cache, *arguments)

    jit._Cache.load_overload = load_overload
    if mutant is not None:
        jit._Cache.save_overload = lambda *_: None


@click.command()
@click.option("--count", default=48, show_default=True, help="Mutants, alike many of each room.")
@click.option("--seed", default=1, show_default=True)
@click.option("--room", "rooms", multiple=True, type=click.Choice(list(TESTS)), help="Only these rooms.")
def main(count: int, seed: int, rooms: tuple[str, ...]) -> None:
    """Run the tests on mutants of the core; exit code 1 if more than one in twenty survives."""
    rooms = rooms or tuple(TESTS)
    chosen, tests = [], {}
    for room in rooms:
        files = sorted((ROOT / "skydiver_utc" / room).rglob("*.py"))
        found = [mutant for file in files for mutant in mutants_of(room, file)]
        share = min(round(count / len(rooms)), len(found))
        chosen += random.Random(f"{seed} {room}").sample(found, share)
        tests[room] = {file for name in TESTS[room].split() for file in (ROOT / "test").glob(name)}
    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as threads:
        files = sorted(set().union(*tests.values()))
        unchanged = dict(zip(files, threads.map(lambda file: run([file]), files), strict=True))
        failed = [str(file) for file in files if not unchanged[file].passed]
        if failed:
            raise click.ClickException(f"without any mutant fail {', '.join(failed)}")
        click.echo(f"{len(files)} files of tests pass without any mutant")

        def seen(mutant: Mutant) -> bool:
            place = mutant.file, mutant.function
            calling = [file for file in tests[mutant.room] if place in unchanged[file].called]
            ran = run(sorted(calling, key=lambda file: unchanged[file].seconds), mutant) if calling else None
            click.echo(f"{'SURVIVES' if ran is None or ran.passed else 'seen'} {mutant.shown()}")
            return ran is not None and not ran.passed

        alive = [mutant for mutant, found in zip(chosen, threads.map(seen, chosen), strict=True) if not found]
    click.echo("\n".join(["Survivors:", *(mutant.shown() for mutant in alive)]))
    for room in rooms:
        click.echo(
            f"{room}: {sum(m.room == room for m in alive)} of {sum(m.room == room for m in chosen)} survive"
        )
    click.echo(f"{len(alive)} of {len(chosen)} survive, seed {seed}")
    sys.exit(20 * len(alive) > len(chosen))


if __name__ == "__main__":
    main()
