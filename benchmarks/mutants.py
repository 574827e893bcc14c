# SPDX-License-Identifier: Apache-2.0
"""Whether the tests see faults: the core with one operator, number or statement changed, its tests run each time.

    python benchmarks/mutants.py --count 48 --seed 1

A mutant survives if the tests of its room pass. The checkout stays as it is: mutants are made in a copy of it.
Annotations and the fields of settings classes are left out: their numbers are data. So are the keywords of `zip` and
`lru_cache` and the arguments of `np.empty`: `strict` is an assertion, and larger caches and scratch change no result.
"""

import ast
import multiprocessing
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from itertools import zip_longest
from pathlib import Path
from typing import NamedTuple

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
# Room -> the tests that are run for its mutants, the cheapest first.
TESTS = {
    "unscented": "unscented controllers/test_utc_against_paper.py",
    "controllers/utc": (
        "controllers/test_utc_against_paper.py controllers/test_utc_results.py controllers/test_utc_recovery.py"
        " controllers/test_utc_between_steps.py controllers/test_utc_beyond_the_paper.py"
        " controllers/test_utc_user_functions.py controllers/test_unscented_transform_controller.py"
        " controllers/test_utc_on_other_plants.py"
    ),
    "plants/skydiver": (
        "plants/test_plant_against_transcription.py plants/test_moving_limbs.py plants/test_steady_falls.py"
        " plants/test_longest_step.py plants/test_patterns.py body/test_movement.py plants estimators/test_sensors.py"
    ),
    "recording": "recording analysis/test_recorded_run.py cli/test_field.py",
    "parameters": (
        "parameters messages theory/test_stability.py body cli/test_run_plans.py cli/test_written_files.py"
        " cli/test_cli.py recording/test_writer.py"
    ),
    "references": "references",
}
LONGEST_S = 900.0  # a mutant whose tests hang is seen
# Class in ast, operator, what stands in its place.
_OPERATORS = (
    *("Add + -", "Sub - +", "Mult * /", "Div / *", "FloorDiv // /", "Mod % *", "Pow ** *"),
    *("Lt < <=", "LtE <= <", "Gt > >=", "GtE >= >", "Eq == !=", "NotEq != =="),
    *("Is is is_not", "IsNot is_not is", "In in not_in", "NotIn not_in in", "And and or", "Or or and"),
)
_SWAPS = {kind: tuple(word.replace("_", " ") for word in swap) for kind, *swap in map(str.split, _OPERATORS)}


class Mutant(NamedTuple):
    """Bytes [start, end) of a file replaced."""

    room: str
    file: Path  # from the root
    data: bytes  # of the file
    start: int
    end: int
    new: str

    def shown(self) -> str:
        line = self.data.count(b"\n", 0, self.start)
        old = " ".join(self.data[self.start : self.end].decode().split())
        text = self.data.splitlines()[line].decode().strip()
        return f"{self.file}:{line + 1}: {old[:60]!r} -> {self.new!r} in: {text}"

    def mutated(self) -> bytes:
        return self.data[: self.start] + self.new.encode() + self.data[self.end :]


def mutants_of(room: str, file: Path) -> list[Mutant]:
    """All mutants of a file."""
    data = (ROOT / file).read_bytes()
    starts = [0]
    for line in data.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))

    def at(line: int, column: int) -> int:
        return starts[line - 1] + column

    def begin(node: ast.expr | ast.stmt) -> int:
        return at(node.lineno, node.col_offset)

    def end(node: ast.expr | ast.stmt) -> int:
        return at(node.end_lineno or 0, node.end_col_offset or 0)

    def between(left: int, right: int, op: ast.AST, ending: str = "") -> Iterator[tuple[int, int, str]]:
        if type(op).__name__ in _SWAPS:
            old, new = _SWAPS[type(op).__name__]
            place = data.find((old + ending).encode(), left, right)
            if place >= 0:
                yield place, place + len(old), new

    def changes(node: ast.AST) -> Iterator[tuple[int, int, str]]:
        match node:
            case ast.BinOp():
                yield from between(end(node.left), begin(node.right), node.op)
            case ast.AugAssign():
                yield from between(end(node.target), begin(node.value), node.op, "=")
            case ast.Compare(ops=[op]):
                yield from between(end(node.left), begin(node.comparators[0]), op)
            case ast.BoolOp():
                yield from between(end(node.values[0]), begin(node.values[1]), node.op)
            case ast.UnaryOp(op=ast.Not()):
                yield begin(node), begin(node) + len("not"), ""
            case ast.Constant(value=bool()):
                yield begin(node), end(node), str(not node.value)
            case ast.Constant(value=int() | float()):
                yield begin(node), end(node), repr(node.value + 1)
            case ast.Raise() | ast.Expr(value=ast.Call()):
                yield begin(node), end(node), "pass"

    found = [
        Mutant(room, file, data, start, stop, new)
        for node in _code(ast.parse(data))
        for start, stop, new in changes(node)
    ]
    return [mutant for mutant in found if mutant.end > mutant.start]


def _code(node: ast.AST) -> Iterator[ast.AST]:
    """The nodes below one, but for what is left out (see above)."""
    left_out = ["annotation", "returns", "decorator_list"]
    if isinstance(node, ast.Call):
        left_out += {"zip": ["keywords"], "lru_cache": ["keywords"], "np.empty": ["args"]}.get(
            ast.unparse(node.func), []
        )
    for name, value in ast.iter_fields(node):
        if name in left_out:
            continue
        for child in value if isinstance(value, list) else [value]:
            field = isinstance(node, ast.ClassDef) and isinstance(child, ast.AnnAssign)
            bounds = isinstance(child, ast.Subscript) and getattr(child.value, "id", "") == "Annotated"
            if isinstance(child, ast.AST) and not field and not bounds:
                yield child
                yield from _code(child)


def survives(mutant: Mutant, copy: Path) -> bool:
    """Whether the tests of its room pass with a mutant, which is taken back afterwards."""
    (copy / mutant.file).write_bytes(mutant.mutated())
    tests = multiprocessing.get_context("fork").Process(target=_test, args=(copy, TESTS[mutant.room].split()))
    tests.start()
    tests.join(LONGEST_S)
    hangs = tests.is_alive()
    if hangs:
        tests.kill()
        tests.join()
    (copy / mutant.file).write_bytes(mutant.data)
    return not hangs and tests.exitcode == 0


def _test(copy: Path, tests: list[str]) -> None:
    """In a process of its own that has the libraries, and nothing of the package, imported already."""
    os.chdir(copy)
    sys.path.insert(0, str(copy))
    sys.dont_write_bytecode = True
    for stream in (1, 2):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
    options = ["-q", "-x", "-n", "0", "-p", "no:cacheprovider", "-m", "not long and not processes"]
    os._exit(pytest.main([*options, *(f"test/{name}" for name in tests)]))


@click.command()
@click.option("--count", default=48, show_default=True, help="Mutants, alike many of each room.")
@click.option("--seed", default=1, show_default=True)
@click.option("--room", "rooms", multiple=True, type=click.Choice(list(TESTS)), help="Only these rooms.")
@click.option("--list", "only_list", is_flag=True, help="List the mutants, run nothing.")
def main(count: int, seed: int, rooms: tuple[str, ...], only_list: bool) -> None:
    """Run the tests on mutants of the core; exit code 1 if one in twenty, or more, survives."""
    rooms = rooms or tuple(TESTS)
    samples = []
    for place, room in enumerate(rooms):
        files = sorted((ROOT / "skydiver_utc" / room).rglob("*.py"))
        found = [mutant for file in files for mutant in mutants_of(room, file.relative_to(ROOT))]
        share = count // len(rooms) + (place < count % len(rooms))
        samples.append(random.Random(f"{seed} {room}").sample(found, min(share, len(found))))
    # By turns, so that a run that is stopped has seen all rooms alike.
    chosen = [mutant for turn in zip_longest(*samples) for mutant in turn if mutant is not None]
    if only_list:
        for mutant in chosen:
            click.echo(mutant.shown())
        return
    survivors: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        names = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True).stdout
        for name in names.decode().split("\0")[:-1]:
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, copy / name)
        for room in rooms:
            first = next(mutant for mutant in chosen if mutant.room == room)
            if not survives(first._replace(end=first.start, new=""), copy):
                raise click.ClickException(f"the tests of {room} fail without any mutant")
        for mutant in chosen:
            began = time.monotonic()
            alive = survives(mutant, copy)
            survivors[mutant.room] += alive
            word = "SURVIVES" if alive else "seen"
            click.echo(f"{word} {time.monotonic() - began:.0f} s {mutant.shown()}")
    for room in rooms:
        click.echo(f"{room}: {survivors[room]} of {sum(m.room == room for m in chosen)} survive")
    click.echo(f"{survivors.total()} of {len(chosen)} survive, seed {seed}")
    sys.exit(20 * survivors.total() > len(chosen))


if __name__ == "__main__":
    main()
