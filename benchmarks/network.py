# SPDX-License-Identifier: Apache-2.0
"""Fly over two machines with a network between them that delays and loses: ``make network``.

Plant and recorder are on one machine, controller and reference on the other (`machines.py`), the estimator of a
scenario that has one on either. In lockstep the flight
must be the simulated one bit for bit, whatever the link does; in real time every step must be accounted for and the
skydiver stay belly to earth.
"""

import json
import math
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import click
from machines import ADDRESSES, Conditions, Machine, two_machines, why_not

from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.analysis.recorded_run import read_run
from skydiver_utc.cli.node_processes import NODE_CODE, PACKAGE_FOLDER
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.loop.run import Run
from skydiver_utc.parameters import load_scenario

SCENARIO = "fast_turn_unknown_dynamics"
MULTICAST = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
# Peers by name, where a network carries no multicast.
STATIC_PEERS = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_STATIC_PEERS": ";".join(ADDRESSES)}
CONDITIONS = (
    Conditions(),
    Conditions(1.0, 0.2, 0.0),
    Conditions(1.0, 0.2, 0.01),
    Conditions(5.0, 1.0, 0.02),
    Conditions(20.0, 5.0, 0.05),
)
_SERVERS = ("controller", "reference")
_GRACE_S = 30.0


class TwoMachines:
    """The nodes of one run on two machines; `folder` gets their logs and the bag."""

    def __init__(
        self,
        machines: tuple[Machine, Machine],
        folder: Path,
        mode: str,
        duration_s: float,
        discovery: Mapping[str, str] = MULTICAST,
        controller: Mapping[str, object] = {},
        plant: Mapping[str, object] = {},
        scenario: str = SCENARIO,
        estimator_at: str = "plant",
    ) -> None:
        plants, controllers = machines
        self.folder = folder
        self._environment = {**os.environ, **discovery, "ROS_DOMAIN_ID": "1", "ROS_LOG_DIR": str(folder)}
        self._environment["PYTHONPATH"] = PACKAGE_FOLDER
        common = {"scenario": scenario, "duration_s": duration_s}
        waiting = {**common, "wait_for_recorder": True}
        places = {
            "recorder": (plants, {**common, "out": folder / "bag"}),
            "controller": (controllers, {**waiting, "mode": mode, **controller}),
            "reference": (controllers, common),
            "plant": (plants, {**waiting, "mode": mode, "progress": True, **plant}),
        }
        if load_scenario(scenario).has_estimator:
            beside, _ = places[estimator_at]
            places["estimator"] = (beside, {**waiting, "mode": mode})
        self._processes = {kind: self._start(kind, *place) for kind, place in places.items()}

    def _start(
        self, kind: str, machine: Machine, parameters: Mapping[str, object]
    ) -> "subprocess.Popen[bytes]":
        command = [sys.executable, "-c", NODE_CODE.format(kind=kind), "--ros-args"]
        for name, value in parameters.items():
            command += ["-p", f"{name}:={str(value).lower() if isinstance(value, bool) else value}"]
        with (self.folder / f"{kind}.log").open("w") as log:
            return subprocess.Popen(
                machine.command(command),
                env=self._environment,
                cwd=self.folder,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
            )

    def log(self, kind: str) -> str:
        """What a node has printed."""
        return (self.folder / f"{kind}.log").read_text(encoding="utf-8")

    def outcome(self, patience_s: float) -> dict[str, Any]:
        """What the plant tells in the end."""
        try:
            self._processes["plant"].wait(patience_s)
            self._processes["recorder"].wait(_GRACE_S)
        except subprocess.TimeoutExpired as error:
            raise RuntimeError(f"{error}; the plant printed:\n{self.log('plant')}") from None
        lines = [line for line in self.log("plant").splitlines() if line.startswith("{")]
        if not lines:
            raise RuntimeError(f"the plant reported no outcome; it printed:\n{self.log('plant')}")
        return dict(json.loads(lines[-1]))

    def end(self) -> None:
        """End every node that still runs."""
        for process in self._processes.values():
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        deadline = time.monotonic() + _GRACE_S
        for process in self._processes.values():
            try:
                process.wait(max(0.0, deadline - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def equals_simulation(flight: Run) -> bool:
    """True where every state and command has the bits of the flight in one process."""
    alone = simulate(flight.scenario)
    return all(
        getattr(flight, name).tobytes() == getattr(alone, name).tobytes()
        for name in ("states", "commands", "applied", "reference")
    )


def belly_to_earth(flight: Run) -> bool:
    """True if the dorsal axis never went below the horizon."""
    return not any(flight.plant.mishap(state) for state in flight.states)


def flight_over(
    conditions: Conditions, mode: str, duration_s: float, delay_steps: int, **of_run: str
) -> list[str]:
    """Fly once; a row of the table: what was, how it went."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="skydiver_utc_network_")))
        machines = stack.enter_context(two_machines(conditions))
        run = TwoMachines(
            machines, folder, mode, duration_s, controller={"delay_steps": delay_steps}, **of_run
        )
        stack.callback(run.end)
        reported = run.outcome(600.0 + 2 * duration_s)
        flight = read_run(folder / "bag")
    error = metrics(flight)["rmse_deg_s"] if mode == "real_time" else math.nan
    rate = (reported["states"] - 1) / reported["wall_time_s"]
    if mode == "lockstep":
        judged = "the simulated one" if equals_simulation(flight) else "DIFFERS"
    else:
        account = reported["real_time"]
        parts = {kind: account[kind] for kind in ("on_time", "late", "stale", "lost")}
        whole = sum(parts.values()) == account["steps"] == flight.scenario.steps
        shares = ", ".join(f"{kind} {100 * n / account['steps']:.1f} %" for kind, n in parts.items())
        judged = f"{shares}{'' if whole else ' UNACCOUNTED'}; RMSE {error:.2f} deg/s"
        judged += "" if belly_to_earth(flight) else "; ROLLED OVER"
    return [str(conditions), mode.replace("_", " "), reported["outcome"], f"{rate:.1f}", judged]


def flight_in_process(conditions: Conditions, duration_s: float, scenario: str) -> list[str]:
    """The same scenario in one process, its measurements late by both ways of the link and lost as there."""
    sensors = load_scenario(scenario).estimator.sensors
    link = {"delay_s": 2e-3 * conditions.delay_ms, "loss": conditions.loss}
    changes = {
        f"estimator.sensors.{sensor}.{name}": value for sensor in sensors for name, value in link.items()
    }
    flight = simulate(load_scenario(scenario, {"duration_s": duration_s, **changes}))
    error = metrics(flight)["rmse_deg_s"]
    return [str(conditions), "in process", flight.outcome.value, "-", f"RMSE {error:.2f} deg/s"]


@click.command()
@click.option("--duration-s", default=20.0, show_default=True, help="Length of each flight.")
@click.option(
    "--mode", "modes", multiple=True, default=("lockstep", "real_time"), help="Only this one; repeatable."
)
@click.option("--scenario", default=SCENARIO, show_default=True, help="Scenario of all flights.")
@click.option(
    "--estimator-at",
    type=click.Choice(["plant", "controller"]),
    default="plant",
    help="Its side of the link.",
)
@click.option(
    "--link", "links", nargs=3, type=float, multiple=True, help="Delay and jitter [ms] and loss; repeatable."
)
@click.option("--delay-steps", default=0, show_default=True, help="Delay compensation of the controller.")
def main(
    duration_s: float,
    modes: tuple[str, ...],
    scenario: str,
    estimator_at: str,
    links: tuple[tuple[float, float, float], ...],
    delay_steps: int,
) -> None:
    """Fly in lockstep and in real time under each condition; print a table in Markdown."""
    if reason := why_not():
        raise click.ClickException(reason)
    flown = load_scenario(scenario, {"duration_s": duration_s})
    steps, each = flown.steps, [Conditions(*link) for link in links] or CONDITIONS
    click.echo(f"{scenario}, {duration_s:g} s ({steps} steps), delay_steps {delay_steps} in real time\n")
    click.echo("| link | mode | outcome | steps/s | the flight |\n|---|---|---|---|---|")
    for mode in modes:
        for conditions in each:
            delay = delay_steps if mode == "real_time" else 0
            place = {"scenario": scenario, "estimator_at": estimator_at}
            row = flight_over(conditions, mode, duration_s, delay, **place)
            click.echo(f"| {' | '.join(row)} |")
    for conditions in each if flown.has_estimator else ():
        click.echo(f"| {' | '.join(flight_in_process(conditions, duration_s, scenario))} |")


if __name__ == "__main__":
    main()
