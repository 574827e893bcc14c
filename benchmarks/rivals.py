"""The table of docs/rivals.md, UTC beside its rivals on the same plant and tasks: ``python benchmarks/rivals.py``.

Each controller flies the fast turn (400 deg/s at 0.2 Hz) with its scenario's parameters, and the slow turn
(180 deg/s at 0.1 Hz) with the same ones. RMSE, convergence and effort as `skydiver-utc simulate` reports them. What
a decision takes is in docs/benchmarks.md.
"""

import click

from skydiver_utc.analysis.metrics import metrics
from skydiver_utc.simulation.closed_loop import simulate
from skydiver_utc.studies.runs import run

FLOWN = {
    one.command: one
    for one in (
        run("fast_turn_pose_only"),
        run("fast_turn_pose_tuned"),
        run("fast_turn_pose_feed_forward"),
        run("fast_turn_lqr"),
        run("fast_turn_gauss_newton_held"),
        run("fast_turn_gauss_newton"),
        run("fast_turn_gauss_newton", ("controller.blocks", 20)),
        run("fast_turn_mppi"),
        run("fast_turn_unknown_dynamics"),
        run("fast_turn_unknown_dynamics_tuned"),
        run("fast_turn_pi_dynamics"),
        run("fast_turn_pi_dynamics_tuned"),
    )
}
SLOW = (("reference.amplitude_deg_s", 180.0), ("reference.frequency_hz", 0.1))


def number(value: float | None) -> str:
    """Two digits, whole numbers from 10 on."""
    if value is None:
        return "never"
    return f"{value:.0f}" if value >= 10.0 else f"{value:#.2g}"


@click.command(help=__doc__)
def main() -> None:
    print("| scenario | RMSE | converged | effort | slow turn: RMSE | effort |")
    print("|---|---|---|---|---|---|")
    for command, one in FLOWN.items():
        fast = metrics(simulate(one.load()))
        slow = metrics(simulate(run(one.scenario, *one.settings, *SLOW).load()))
        print(
            f"| `{command}` | {number(fast['rmse_deg_s'])} | {number(fast['convergence_time_s'])}"
            f" | {number(fast['control_effort'])} | {number(slow['rmse_deg_s'])}"
            f" | {number(slow['control_effort'])} |"
        )
        for outcome in (fast, slow):
            if outcome["outcome"] != "completed":
                print(f"<!-- {command}: {outcome['outcome']}, {outcome['reason']} -->")


if __name__ == "__main__":
    main()
