# SPDX-License-Identifier: Apache-2.0
"""CPU time of a flight of 20 s in process, and where it goes: ``python benchmarks/flight_time.py [SCENARIO ...]``.

Each flight is flown --repeats times; the flight is the smallest CPU time of them, the decisions are the median of one
times their number, building is that of the slots, the rest is the plant and the loop. On a busy machine CPU times
grow, too: compare them with a decision of docs/benchmarks.md.
"""

import time
from collections.abc import Callable
from typing import TypeVar

import click
import numpy as np

from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.parameters import load_scenario, override

SCENARIOS = (
    "fast_turn_pi_dynamics_tuned",
    "fast_turn_pi_dynamics",
    "fast_turn_unknown_dynamics_tuned",
    "fast_turn_unknown_dynamics",
    "fast_turn_pose_tuned",
    "fast_turn_lqr",
    "fast_turn_gauss_newton",
    "fast_turn_mppi",
)
Found = TypeVar("Found")


def least_ms(call: Callable[[], Found], repeats: int) -> tuple[float, Found]:
    """Smallest CPU time [ms] of some calls, and what the last returned."""
    times = []
    for _ in range(repeats):
        began = time.process_time()
        found = call()
        times.append(1e3 * (time.process_time() - began))
    return min(times), found


@click.command(help=__doc__)
@click.argument("scenarios", nargs=-1)
@click.option("--repeats", default=5, show_default=True)
def main(scenarios: tuple[str, ...], repeats: int) -> None:
    print("| scenario | flight [ms] | decisions | plant and loop | building | settings | metrics |")
    print("|---|---|---|---|---|---|---|")
    for name in scenarios or SCENARIOS:
        scenario = load_scenario(name)
        step = scenario.replace(duration_s=scenario.dt_s)
        simulate(step)
        changed, _ = least_ms(lambda: override(scenario, {"plant.initial.bank_deg": 1.0}), repeats)  # noqa: B023
        build, _ = least_ms(lambda: simulate(step), repeats)  # noqa: B023
        flight, run = least_ms(lambda: simulate(scenario), repeats)  # noqa: B023
        found, _ = least_ms(lambda: (run.__dict__.pop("outputs", None), metrics(run)), repeats)  # noqa: B023
        decisions = 1e3 * float(np.median(run.solve_time_s)) * len(run.solve_time_s)
        rest = flight - decisions - build
        print(
            f"| `{name}` | {flight:.0f} | {decisions:.0f} | {rest:.0f} | {build:.0f} | {changed:.0f} | {found:.0f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
