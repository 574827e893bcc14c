# SPDX-License-Identifier: Apache-2.0
"""Fly over two machines with a network between them that delays and loses: ``make network``.

Plant and recorder are on one machine, controller and reference on the other (`machines.py`), the estimator of a
scenario that has one on either. In lockstep the flight must be the simulated one bit for bit, whatever the link does;
in real time every step must be accounted for and the skydiver stay belly to earth.
"""

import math
import os
import tempfile
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import click
from flights import outcome_of
from machines import ADDRESSES, Conditions, Machine, two_machines, why_not

from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.analysis.recorded_run import read_run
from skydiver_utc.cli.node_processes import (
    CONTROLLER,
    ESTIMATOR,
    PLANT,
    RECORDER,
    REFERENCE,
    NodeProcesses,
    Parameters,
)
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


def fly_over(
    machines: tuple[Machine, Machine],
    folder: Path,
    mode: str,
    duration_s: float,
    discovery: Mapping[str, str] = MULTICAST,
    delay_steps: int = 0,
    scenario: str = SCENARIO,
    estimator_at: str = PLANT,
) -> dict[str, Any]:
    """One flight on two machines, what the plant reported last; `folder` gets the nodes' logs and the bag."""
    plants, controllers = machines
    environment = {**os.environ, **discovery, "ROS_DOMAIN_ID": "1", "ROS_LOG_DIR": str(folder)}
    common: Parameters = {"scenario": scenario, "duration_s": duration_s}
    waiting: Parameters = {**common, "wait_for_recorder": True, "mode": mode}
    places: dict[str, tuple[Machine, Parameters]] = {
        RECORDER: (plants, {**common, "out": str(folder / "bag")}),
        CONTROLLER: (controllers, {**waiting, "delay_steps": delay_steps}),
        REFERENCE: (controllers, common),
        PLANT: (plants, {**waiting, "progress": True}),
    }
    if load_scenario(scenario).has_estimator:
        places[ESTIMATOR] = (places[estimator_at][0], waiting)
    with NodeProcesses(environment, folder) as nodes:
        for kind, (machine, parameters) in places.items():
            nodes.start(kind, parameters, machine.command(()))
        return outcome_of(nodes)


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
        reported = fly_over(machines, folder, mode, duration_s, delay_steps=delay_steps, **of_run)
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
