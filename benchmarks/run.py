# SPDX-License-Identifier: Apache-2.0
"""Time what matters, in one run on this machine: ``make bench``.

Rows of one group take turns; `ratio` is the median as a multiple of the group's first. All times are processor
times: other load is not counted, but for the caches and the clock rate that it takes away.
"""

import json
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import asdict
from importlib.util import find_spec

import click
import startup
from c_transcription import compiler, library
from controllers import FAST, c_step, decision, short
from rich.console import Console
from rich.progress import track
from timing import Group, Row, Subject, machine

from skydiver_utc.loop.build import build_plant
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.parameters import load_scenario

_STEPS_IN_A_LOOP = 2000
# Label: scenario and what is changed in it. All look twenty steps ahead; MPPI's are four control periods long.
_RIVALS: dict[str, tuple[str, dict[str, object]]] = {
    "Gauss-Newton, one held control": ("fast_turn_gauss_newton_held", {}),
    "Gauss-Newton, five controls": ("fast_turn_gauss_newton", {}),
    "Gauss-Newton, a control for every step": ("fast_turn_gauss_newton", {"controller.blocks": 20}),
    "MPPI, 64 samples": ("fast_turn_mppi", {}),
    "linear-quadratic regulator": ("fast_turn_lqr", {}),
    "pose": ("fast_turn_pose_only", {}),
}
_SHORT_RIVALS: dict[str, tuple[str, dict[str, object]]] = {
    "UTC, eq:m1utc": ("fast_turn_pi_dynamics", {}),
}


def plant_step() -> float:
    """One step of the plant, called from Python, its posture moving [s]."""
    plant = build_plant(load_scenario(FAST))
    state, before = plant.initial_state(), plant.initial_applied()
    begin = time.process_time()
    for _ in range(_STEPS_IN_A_LOOP):
        state = plant.step(state, before, before)
    return (time.process_time() - begin) / _STEPS_IN_A_LOOP


def whole_flight() -> Callable[[], float]:
    """`simulate fast_turn_unknown_dynamics`, 4762 steps [s]."""
    scenario = load_scenario(FAST)

    def once() -> float:
        begin = time.process_time()
        simulate(scenario)
        return time.process_time() - begin

    return once


def control_steps(stack: ExitStack) -> Iterator[Group]:
    """UTC at two horizons beside C and the other controllers."""
    loaded = stack.enter_context(library()) if compiler() else None
    for steps, rivals in ((20, _RIVALS), (5, _SHORT_RIVALS)):
        scenario = short(FAST, {"controller.horizon_steps": steps})
        subjects = [Subject("UTC", decision(scenario), batch=20)]
        if loaded is not None:
            subjects.append(Subject("UTC in C (c/utc_step.c)", c_step(loaded, scenario), batch=20))
        subjects += [
            Subject(label, decision(short(name, changes)), batch=20)
            for label, (name, changes) in rivals.items()
        ]
        yield Group(f"one control step, N = {steps}", subjects, rounds=150)


def chains() -> Iterator[Group]:
    """UTC beside the tool chains, where they and a C compiler are installed."""
    if any(find_spec(name) is None for name in ("casadi", "do_mpc", "osqp")):
        click.echo("The tool chains are left out: pip install '.[bench]' brings them.", err=True)
        return
    if compiler() is None:
        click.echo(
            "The tool chains are left out: they are compiled, and there is no C compiler (cc).", err=True
        )
        return
    from tool_chains.flight import tool_chains

    for steps in (20, 5):
        scenario = short(FAST, {"controller.horizon_steps": steps})
        subjects = [Subject("UTC", decision(scenario), batch=20), *tool_chains(steps)]
        yield Group(f"one control step, tool chains, N = {steps}", subjects, rounds=15)


def parts() -> Iterator[Group]:
    """What a step is made of, and what is made of steps."""
    yield Group("one step of the skydiver", (Subject("the plant", plant_step),), rounds=20)
    yield Group(
        "a flight of 4762 steps", (Subject("simulate fast turn", whole_flight(), unit="s"),), rounds=5
    )


def starts(stack: ExitStack) -> Iterator[Group]:
    """What a user waits for before anything flies."""
    fresh = stack.enter_context(startup.fresh_install())
    cold = startup.process(startup.FIRST_DECISION, fresh)()
    rows = (
        Subject("start of Python alone", startup.process(startup.NOTHING, fresh), unit="s"),
        Subject("skydiver-utc --help", startup.process(startup.HELP, fresh), unit="s"),
        Subject("import of the package", startup.process(startup.IMPORT, fresh), unit="s"),
        Subject("first decision, kernels cached", startup.process(startup.FIRST_DECISION, fresh), unit="s"),
    )
    yield Group("start of a process", rows, rounds=5)
    compiling = Subject("first decision after install", lambda: cold, unit="s")
    yield Group("start of a process that compiles the kernels", (compiling,), rounds=1)


def measure() -> list[Row]:
    """All rows."""
    with ExitStack() as stack:
        groups = [*control_steps(stack), *chains(), *parts(), *starts(stack)]
        return [
            row
            for group in track(groups, "measuring", console=Console(stderr=True))
            for row in group.measure()
        ]


def markdown(rows: list[Row], where: dict[str, str]) -> str:
    """The table of docs/benchmarks.md."""
    lines = [", ".join(f"{name} {value}" for name, value in where.items()) + ".", ""]
    lines += ["| | median | p99 or max | unit | ratio | repetitions |", "|---|---|---|---|---|---|"]
    group = ""
    for row in rows:
        if row.group != group:
            group = row.group
            lines.append(f"| **{group}** | | | | | |")
        cells = (row.name, f"{row.median:g}", row.slow_end, row.unit, f"{row.ratio:g}", str(row.repetitions))
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


@click.command(help=__doc__)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of a table.")
def main(as_json: bool) -> None:
    """Time the controllers, the skydiver and the start of the program on this machine."""
    rows, where = measure(), machine()
    if as_json:
        click.echo(json.dumps({"machine": where, "rows": [asdict(row) for row in rows]}, indent=2))
    else:
        click.echo(markdown(rows, where))


if __name__ == "__main__":
    main()
