# SPDX-License-Identifier: Apache-2.0
"""The table of docs/rivals.md, UTC beside its rivals on the same plant and tasks: ``python benchmarks/rivals.py``.

Each controller flies the fast turn (400 deg/s at 0.2 Hz) with its scenario's parameters, and the slow turn
(180 deg/s at 0.1 Hz) with the same ones, with the paper's skydiver or with ``--skydiver athlete``. RMSE, convergence
and effort as `skydiver-utc simulate` reports them. What a decision takes is in docs/benchmarks.md. With
--tool-chains the rows of tool_chains/tuned.yaml instead, some ten minutes: ``make rivals-tools``.
"""

from collections.abc import Iterator
from typing import NamedTuple

import click
from athlete import flown_by

from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.loop.build import build_controller
from skydiver_utc.loop.closed_loop import Build, simulate
from skydiver_utc.parameters import Scenario
from skydiver_utc.studies.cases import case

FLOWN = {
    one.command: one
    for one in (
        case("fast_turn_pose_only"),
        case("fast_turn_pose_tuned"),
        case("fast_turn_pose_feed_forward"),
        case("fast_turn_lqr"),
        case("fast_turn_gauss_newton_held"),
        case("fast_turn_gauss_newton"),
        case("fast_turn_gauss_newton", ("controller.blocks", 20)),
        case("fast_turn_mppi"),
        case("fast_turn_unknown_dynamics"),
        case("fast_turn_unknown_dynamics_tuned"),
        case("fast_turn_pi_dynamics"),
        case("fast_turn_pi_dynamics_tuned"),
        case("fast_turn_beyond_the_paper"),
    )
}
SLOW = (("reference.amplitude_deg_s", 180.0), ("reference.frequency_hz", 0.1))


class Entry(NamedTuple):
    """A row's name, what is flown, and what builds its controller."""

    name: str
    fast: Scenario
    slow: Scenario
    build: Build


def package(skydiver: str) -> Iterator[Entry]:
    """The controllers of the package."""
    for command, one in FLOWN.items():
        settings = dict(one.settings) | flown_by(skydiver, one.scenario)
        fast, slow = (case(one.scenario, *(settings | dict(turn)).items()) for turn in ((), SLOW))
        yield Entry(command, fast.load(), slow.load(), build_controller)


def chains(skydiver: str) -> Iterator[Entry]:
    """The tool chains, which are an extra."""
    from tool_chains.chains import controller_of, tuned

    who = {"plant.skydiver": skydiver}
    slow = tuned({**who, **dict(SLOW)})
    for name, (chain, fast) in tuned(who).items():
        yield Entry(name, fast, slow[name].scenario, controller_of(chain))


def number(value: float | None) -> str:
    """Two digits, whole numbers from 10 on."""
    if value is None:
        return "never"
    return f"{value:.0f}" if value >= 10.0 else f"{value:#.2g}"


@click.command(help=__doc__)
@click.option("--tool-chains", is_flag=True, help="The rows of the tool chains (extra bench).")
@click.option("--skydiver", default="paper", show_default=True, help="Who is flown, as plant.skydiver.")
def main(tool_chains: bool, skydiver: str) -> None:
    print("| scenario | RMSE | converged | effort | slow turn: RMSE | effort |")
    print("|---|---|---|---|---|---|")
    for entry in chains(skydiver) if tool_chains else package(skydiver):
        fast, slow = (metrics(simulate(s, build=entry.build)) for s in (entry.fast, entry.slow))
        print(
            f"| `{entry.name}` | {number(fast['rmse_deg_s'])} | {number(fast['convergence_time_s'])}"
            f" | {number(fast['control_effort'])} | {number(slow['rmse_deg_s'])}"
            f" | {number(slow['control_effort'])} |",
            flush=True,
        )
        for flown in (fast, slow):
            if flown["outcome"] != "completed":
                print(f"<!-- {entry.name}: {flown['outcome']}, {flown['reason']} -->")
            if kept := flown["status_steps"]["kept_previous"]:
                print(f"<!-- {entry.name}: without an answer in {kept} steps -->")


if __name__ == "__main__":
    main()
