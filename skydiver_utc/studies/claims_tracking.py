# SPDX-License-Identifier: Apache-2.0
"""Claims about UTC as it is configured in the paper."""

from collections.abc import Iterator

from skydiver_utc.controllers.utc.settings import UtcSettings
from skydiver_utc.loop.linear_loop import updated_control
from skydiver_utc.studies import paper_cases as flown
from skydiver_utc.studies.cases import shipped
from skydiver_utc.studies.claim import Claim, decided, listed, rmse_of
from skydiver_utc.studies.claims_theory import mean_square
from skydiver_utc.studies.markdown import figure
from skydiver_utc.studies.paper_results import PaperResults

_LAYOUT_DEG = 10.0
# Statuses of steps in which a controller finds no way.
_STUCK = ("kept_previous", "not_reached", "no_effect")


def of_tracking(results: PaperResults) -> Iterator[Claim]:
    """In the paper's order."""
    rmse = rmse_of(results, flown.PAPER_UTC)
    at_bars = (
        f"RMSE at most {listed(flown.BARS)} deg/s in the paper's three configurations of UTC",
        f"RMSE {listed(rmse)} deg/s",
        [value <= bar for value, bar in zip(rmse, flown.BARS, strict=True)],
    )
    yield decided("UTC accurately tracks the desired maneuver", *at_bars)

    layouts = [(one.command, results.of(one)) for one in flown.LAYOUTS]
    yield decided(
        "It also flies front and back layouts, through head to earth",
        f"ends on the other side, the angle turned at most {_LAYOUT_DEG:g} deg off",
        "; ".join(
            f"`{command}`: {one.facing}, {figure(abs(one.angle_error_deg or 0.0))} deg off"
            for command, one in layouts
        ),
        [
            one.facing == side and abs(one.angle_error_deg or 0.0) <= _LAYOUT_DEG
            for (_, one), side in zip(layouts, ("back to earth", "belly to earth"), strict=True)
        ],
    )

    yield mean_square(updated_control)

    controls, cost = len(shipped(flown.M0_C2.scenario).plant.limits.minimum), results.cost
    yield decided(
        "Propagating nine sigma points costs less than solving a nonlinear program",
        "one Gauss-Newton iteration on the same prediction takes longer, for a control of every step and for one",
        f"one iteration, of which a solution takes several: x {figure(cost.every_step)} of UTC's time for a"
        f" control of each of the 20 steps; for one held control x {figure(cost.held)}, with {controls + 1}"
        f" roll-outs beside UTC's {2 * controls + 1}",
        [cost.every_step > 1.0, cost.held > 1.0],
        "To convergence, by CasADi and IPOPT: `make bench-tools`.",
    )

    yield _no_convergence_problems(results)

    yield decided(
        "The control outputs need not be parameterised as in nonlinear MPC",
        f"with four numbers a decision, one for each control, {at_bars[0]}",
        *at_bars[1:],
        remark="One held control serves Gauss-Newton as well (docs/rivals.md).",
    )


def _no_convergence_problems(results: PaperResults) -> Claim:
    """Steps without an answer, and steps in which the controller is stuck."""
    usual = {one.command for one in flown.CONFIGURATIONS.values()}
    flights = {
        command: results.of(one)
        for command, one in flown.all_cases().items()
        if isinstance(shipped(one.scenario).controller, UtcSettings)
    }
    steps = sum(sum(one.status_steps.values()) for one in flights.values())
    kept = {
        command: sum(one.status_steps.get(status, 0) for status in _STUCK) for command, one in flights.items()
    }
    stuck = [f"`{command}`" for command, count in kept.items() if count]
    where = f", all in {', '.join(stuck)}" if stuck else ""
    rescued = {command: one.rescued_steps for command, one in flights.items() if one.rescued_steps}
    saved = ", ".join(
        f"`{command}` ({count} steps, RMSE {figure(flights[command].rmse_deg_s)} deg/s)"
        for command, count in rescued.items()
    )
    return decided(
        "There are no convergence problems that optimization engines have to deal with",
        "no step of UTC without an answer, none in which no control moves the output or a reference that stands still"
        " stays out of reach; none that has one only because this package takes the covariances about"
        " the central point, in the configurations and in any other flight",
        f"{sum(kept.values())} of {steps} steps in {len(flights)} flights without an answer or stuck{where}; steps with"
        f" covariances about the central point: {saved or 'none'}",
        [not stuck, not usual & rescued.keys(), not rescued],
        "With a weight W0 far below zero the covariance of the predicted output turns negative, and the paper's"
        " equations have no answer.",
    )
