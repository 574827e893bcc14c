"""Time what matters, in one run on this machine: ``make bench``.

Each row is the median and the 99th percentile of many repetitions. The machine may be shared: trust the ratios
within one run, not the microseconds of two.
"""

import json
import platform
import subprocess
import sys
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import click
import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from skydiver_utc.jit import kernel
from skydiver_utc.parameters import load_scenario
from skydiver_utc.plant.dynamics import WORK_SIZE, drive_limbs, moving_step, rk4_step
from skydiver_utc.simulation.build import build_controller, build_plant, build_reference
from skydiver_utc.simulation.closed_loop import simulate

FAST = "fast_turn_unknown_dynamics"
_STEPS_IN_A_LOOP = 2000


@kernel
def _many_steps(model, state, control, work, count):
    for i in range(count):
        control[3] = 1e-3 * (i % 1000)
        rk4_step(model, state, control, state, work)


@kernel
def _many_moving_steps(model, state, applied, work, count):
    for i in range(count):
        before = applied.copy()
        drive_limbs(model, 1e-3 * (i % 1000), before, applied)
        moving_step(model, state, before, applied, state, work)


def plant_step(steps: Callable[..., None], size: int) -> Callable[[], float]:
    """One RK4 step inside a jitted loop, with an applied control of `size` numbers [s]."""
    plant = build_plant(load_scenario(FAST))
    start, work = plant.initial_state(), np.empty(WORK_SIZE)

    def once() -> float:
        state, applied = start.copy(), np.zeros(size)
        begin = time.perf_counter()
        steps(plant.model, state, applied, work, _STEPS_IN_A_LOOP)
        return (time.perf_counter() - begin) / _STEPS_IN_A_LOOP

    return once


def controller_call(name: str) -> Callable[[], float]:
    """One decision of a scenario's controller, along its own flight [s]."""
    scenario = load_scenario(name, {"duration_s": 5.0})
    flight = simulate(scenario)
    controller = build_controller(scenario)
    profile = build_reference(scenario).preview(0, scenario.steps + controller.preview_steps + 1)
    position = 0

    def once() -> float:
        nonlocal position
        k = position % scenario.steps
        if k == 0:
            controller.reset()
        position += 1
        preview = profile[k : k + controller.preview_steps + 1]
        begin = time.perf_counter()
        controller.decide(flight.states[k], preview)
        return time.perf_counter() - begin

    return once


def whole_flight() -> Callable[[], float]:
    """`simulate fast_turn_unknown_dynamics`, 4762 steps [s]."""
    scenario = load_scenario(FAST)
    return lambda: simulate(scenario).wall_time_s


def command(*arguments: str) -> Callable[[], float]:
    """A command of its own process, start to end [s]."""

    def once() -> float:
        begin = time.perf_counter()
        subprocess.run(
            [sys.executable, "-m", "skydiver_utc.cli", *arguments], check=True, capture_output=True
        )
        return time.perf_counter() - begin

    return once


ROWS: tuple[tuple[str, str, float, int, Callable[[], Callable[[], float]]], ...] = (
    ("model step, RK4, posture held", "us", 1e6, 200, lambda: plant_step(_many_steps, 4)),
    ("plant step, RK4, posture moving", "us", 1e6, 200, lambda: plant_step(_many_moving_steps, 5)),
    ("UTC step, N = 20", "us", 1e6, 2000, lambda: controller_call(FAST)),
    ("UTC step, N = 5, eq:m1utc", "us", 1e6, 2000, lambda: controller_call("fast_turn_pi_dynamics")),
    ("pose controller step", "us", 1e6, 2000, lambda: controller_call("fast_turn_pose_only")),
    ("simulate fast turn, 4762 steps", "s", 1.0, 5, whole_flight),
    ("skydiver-utc --help", "s", 1.0, 5, lambda: command("--help")),
)


def measure() -> list[dict[str, object]]:
    """All rows: name, unit, median, p99 and repetitions."""
    table: list[dict[str, object]] = []
    for name, unit, scale, repetitions, prepare in track(ROWS, "measuring", console=Console(stderr=True)):
        once = prepare()
        once()
        times = scale * np.array([once() for _ in range(repetitions)])
        table.append(
            {
                "name": name,
                "unit": unit,
                "median": round(float(np.median(times)), 3),
                "p99": round(float(np.percentile(times, 99)), 3),
                "repetitions": repetitions,
            }
        )
    return table


def machine() -> dict[str, str]:
    """What the figures were measured on."""
    cpu = next(
        (
            line.split(":")[1].strip()
            for line in Path("/proc/cpuinfo").read_text().splitlines()
            if "model name" in line
        ),
        platform.processor(),
    )
    versions = {name: version(name) for name in ("numpy", "numba", "scipy")}
    return {"cpu": cpu, "python": platform.python_version(), **versions}


@click.command()
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of a table.")
def main(as_json: bool) -> None:
    """Time the plant, the controllers and the closed loop on this machine."""
    rows, where = measure(), machine()
    if as_json:
        click.echo(json.dumps({"machine": where, "rows": rows}, indent=2))
        return
    table = Table(title=", ".join(f"{key} {value}" for key, value in where.items()))
    for heading in ("", "median", "p99", "unit"):
        table.add_column(heading, justify="left" if heading in ("", "unit") else "right")
    for row in rows:
        table.add_row(str(row["name"]), f"{row['median']:.3g}", f"{row['p99']:.3g}", str(row["unit"]))
    Console().print(table)


if __name__ == "__main__":
    main()
