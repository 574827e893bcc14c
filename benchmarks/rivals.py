"""UTC beside its rivals, on the same plant, tasks and clock: ``python benchmarks/rivals.py`` prints the table of
docs/rivals.md.

Each controller flies the fast turn (400 deg/s at 0.2 Hz) with its scenario's parameters, and the slow turn
(180 deg/s at 0.1 Hz) with the same ones. RMSE, convergence and effort as `skydiver-utc simulate` reports them. The
time of one decision is taken in turns, some decisions of each controller along its own fast turn and then those of
the next, so that a busy machine is busy for all; `ratio` is the median over that of fast_turn_unknown_dynamics.
"""

import time
from collections.abc import Callable

import click
import numpy as np

from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.parameters import load_scenario
from skydiver_utc.simulation.build import build_controller, build_reference
from skydiver_utc.simulation.closed_loop import simulate
from skydiver_utc.simulation.flight import Flight

SCENARIOS = (
    "fast_turn_pose_only",
    "fast_turn_pose_tuned",
    "fast_turn_pose_feed_forward",
    "fast_turn_lqr",
    "fast_turn_gauss_newton_held",
    "fast_turn_gauss_newton",
    "fast_turn_mppi",
    "fast_turn_unknown_dynamics",
    "fast_turn_unknown_dynamics_tuned",
    "fast_turn_pi_dynamics",
    "fast_turn_pi_dynamics_tuned",
)
UNIT = "fast_turn_unknown_dynamics"
_IN_A_ROW = 50
SLOW = {"kind": "sine", "amplitude_deg_s": 180.0, "frequency_hz": 0.1}


def decisions(flight: Flight) -> Callable[[int], float]:
    """The time [s] of the controller's decision at step k of its own flight; steps are asked for in order."""
    controller = build_controller(flight.scenario)
    profile = build_reference(flight.scenario).preview(0, len(flight.states) + controller.preview_steps)

    def decide(k: int) -> float:
        preview = profile[k : k + controller.preview_steps + 1]
        begin = time.perf_counter()
        controller.decide(flight.states[k], preview)
        return time.perf_counter() - begin

    return decide


def timed(flights: dict[str, Flight]) -> dict[str, np.ndarray]:
    """Times of all decisions [us], taken in turns; the first second is left out."""
    deciders = {name: decisions(flight) for name, flight in flights.items()}
    steps = min(len(flight.commands) for flight in flights.values())
    times: dict[str, list[float]] = {name: [] for name in deciders}
    for begin in range(0, steps, _IN_A_ROW):
        for name, decide in deciders.items():
            times[name] += [decide(k) for k in range(begin, min(begin + _IN_A_ROW, steps))]
    first = round(1.0 / next(iter(flights.values())).scenario.dt_s)
    return {name: 1e6 * np.array(values[first:]) for name, values in times.items()}


def number(value: float | None, digits: int = 2) -> str:
    return "never" if value is None else f"{value:.{digits}g}"


@click.command(help=__doc__)
def main() -> None:
    fast = {name: simulate(load_scenario(name)) for name in SCENARIOS}
    slow = {name: metrics(simulate(load_scenario(name, {"reference": SLOW}))) for name in SCENARIOS}
    times = timed(fast)
    unit = float(np.median(times[UNIT]))
    print("| scenario | RMSE | converged | effort | slow: RMSE | effort | median [us] | p99 [us] | ratio |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name, flight in fast.items():
        values, median = metrics(flight), float(np.median(times[name]))
        print(
            f"| `{name}` | {number(values['rmse_deg_s'])} | {number(values['convergence_time_s'])}"
            f" | {number(values['control_effort'])} | {number(slow[name]['rmse_deg_s'])}"
            f" | {number(slow[name]['control_effort'])} | {median:.0f}"
            f" | {np.percentile(times[name], 99):.0f} | {median / unit:.2f} |"
        )
        for outcome in (values, slow[name]):
            if outcome["outcome"] != "completed":
                print(f"<!-- {name}: {outcome['outcome']}, {outcome['reason']} -->")


if __name__ == "__main__":
    main()
