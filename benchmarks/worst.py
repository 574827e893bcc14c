# SPDX-License-Identifier: Apache-2.0
"""The slowest of a million steps of UTC, in docs/benchmarks.md: ``make worst``, some four minutes.

UTC of the skydiver at N = 5 and of the ship of textbook_plants.py at N = 10, each along one flight again and again.
Wall: what a caller waits for, whatever else the machine does meanwhile. Processor: what the step itself takes. The
process asks for priority (nice -5) and says whether it got it; Python's garbage collector stays on.
"""

import os
import time
from typing import NamedTuple

import click
import numpy as np
from controllers import FAST, short
from rich.console import Console
from rich.progress import track
from textbook_plants import TextbookPlant
from timing import machine

from skydiver_utc.controllers.protocol import Controller, Status
from skydiver_utc.controllers.utc.settings import UtcSettings
from skydiver_utc.controllers.utc.unscented_transform_controller import UnscentedTransformController
from skydiver_utc.loop.build import build_controller, build_plant, build_reference
from skydiver_utc.loop.closed_loop import simulate

PRIORITY = -5
_ROUND = 10_000


class Replay(NamedTuple):
    """A controller with the states (K, n) and the profile of the reference that it is given, step after step."""

    name: str
    controller: Controller
    states: np.ndarray
    profile: np.ndarray

    def times(self, count: int) -> np.ndarray:
        """Wall and processor time of each step [us] (count, 2); a step that keeps its control is a RuntimeError."""
        decide, ahead = self.controller.decide, self.controller.preview_steps + 1
        wall, cpu, kept = time.perf_counter_ns, time.thread_time_ns, False
        found = np.empty((count, 2), dtype=np.int64)
        rounds = range(0, count, _ROUND)
        for first in track(rounds, self.name, console=Console(stderr=True)):
            for i in range(first, min(first + _ROUND, count)):
                k = i % len(self.states)
                if k == 0:
                    self.controller.reset()
                state, preview = self.states[k], self.profile[k : k + ahead]
                wall_begin = wall()
                cpu_begin = cpu()
                decision = decide(state, preview)
                cpu_end = cpu()
                wall_end = wall()
                found[i] = wall_end - wall_begin, cpu_end - cpu_begin
                kept = kept or decision.status == Status.KEPT_PREVIOUS
        if kept:
            raise RuntimeError(f"{self.name}: a step had no answer, so that its time means nothing")
        return found / 1e3


def skydiver() -> Replay:
    """The fast turn at N = 5."""
    scenario = short(FAST, {"controller.horizon_steps": 5})
    flight, reference = simulate(scenario), build_reference(scenario)
    controller = build_controller(scenario, build_plant(scenario), reference)
    steps = len(flight.commands)
    profile = reference.preview(0, steps + controller.preview_steps + 1)
    return Replay("skydiver, N = 5", controller, flight.states[:steps], profile)


def ship() -> Replay:
    """A slow wave of the heading, one control and two states."""
    plant = TextbookPlant("ship", lead=20.0)
    controller = UnscentedTransformController(UtcSettings(horizon_steps=10), plant)
    steps = 1000
    profile = 0.3 * np.sin(np.arange(steps + controller.preview_steps + 1)[:, None] / 50.0)
    states, state, before = np.empty((steps, 2)), plant.initial_state(), plant.initial_control()
    for k in range(steps):
        states[k] = state
        control = controller.decide(state, profile[k : k + controller.preview_steps + 1]).control
        state = plant.step(state, before, control)
        before = control
    return Replay("ship, N = 10", controller, states, profile)


def priority() -> str:
    """What of the wish for priority was granted."""
    try:
        return f"nice {os.nice(PRIORITY)}"
    except PermissionError:
        return f"nice {os.nice(0)} ({PRIORITY} not allowed)"


@click.command(help=__doc__)
@click.option("--count", default=1_000_000, show_default=True, help="Steps of each controller.")
def main(count: int) -> None:
    where = machine() | {"priority": priority()}
    print("| UTC of | clock | median | 99.9 % | worst | unit |\n|---|---|---|---|---|---|")
    for replay in (skydiver(), ship()):
        replay.times(min(count, _ROUND))
        for clock, times in zip(("wall", "processor"), replay.times(count).T, strict=True):
            median, late, worst = (
                f"{float(f'{value:.3g}'):g}" for value in np.percentile(times, (50.0, 99.9, 100.0))
            )
            print(f"| {replay.name} | {clock} | {median} | {late} | {worst} | us |")
    print(f"\n*{count} steps each; " + ", ".join(f"{name} {value}" for name, value in where.items()) + ".*")


if __name__ == "__main__":
    main()
