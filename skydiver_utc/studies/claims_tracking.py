# SPDX-License-Identifier: Apache-2.0
"""Claims about UTC as it is configured in the paper."""

from skydiver_utc.controllers.utc.settings import UtcSettings
from skydiver_utc.studies import paper_cases as flown
from skydiver_utc.studies.cases import shipped
from skydiver_utc.studies.claim import CLEARLY, Claim, decided, listed, rmse_of
from skydiver_utc.studies.markdown import figure
from skydiver_utc.studies.paper_results import PaperResults

_LAYOUT_DEG = 10.0
# Statuses of steps in which a controller finds no way.
_STUCK = ("kept_previous", "not_reached", "no_effect")


def tracks(results: PaperResults) -> Claim:
    """The paper's three configurations."""
    return _at_the_bars(results, "UTC accurately tracks the desired maneuver", "")


def not_parameterised(results: PaperResults) -> Claim:
    """Against control sequences with a parameter for each piece of the horizon."""
    words = "The control outputs need not be parameterised as in nonlinear MPC"
    claim = _at_the_bars(results, words, "with four numbers a decision, one for each control, ")
    return claim._replace(why=claim.why or "One held control serves Gauss-Newton as well (docs/rivals.md).")


def _at_the_bars(results: PaperResults, words: str, before: str) -> Claim:
    found = rmse_of(results, flown.PAPER_UTC)
    return decided(
        words,
        f"{before}RMSE at most {listed(flown.BARS)} deg/s in the paper's three configurations of UTC",
        f"RMSE {listed(found)} deg/s",
        [value <= bar for value, bar in zip(found, flown.BARS, strict=True)],
    )


def layouts(results: PaperResults) -> Claim:
    """Other maneuvers, from the paper's source c3."""
    found = [results.of(one) for one in flown.LAYOUTS]
    texts = [
        f"`{one.command}`: {measures.facing}, {figure(abs(measures.angle_error_deg or 0.0))} deg off"
        for one, measures in zip(flown.LAYOUTS, found, strict=True)
    ]
    parts = [
        measures.facing == side and abs(measures.angle_error_deg or 0.0) <= _LAYOUT_DEG
        for measures, side in zip(found, ("back to earth", "belly to earth"), strict=True)
    ]
    return decided(
        "It also flies front and back layouts, through head to earth",
        f"ends on the other side, the angle turned at most {_LAYOUT_DEG:g} deg off",
        "; ".join(texts),
        parts,
    )


def cheaper(results: PaperResults) -> Claim:
    """Against optimisation, by the time of whole steps."""
    controls = len(shipped(flown.M0_C2.scenario).plant.limits.minimum)
    return decided(
        "Propagating nine sigma points costs less than solving a nonlinear program",
        "one Gauss-Newton iteration on the same prediction takes longer, for a control of every step and for one",
        f"one iteration, of which a solution takes several: x {figure(results.cost.every_step)} of UTC's time for a"
        f" control of each of the 20 steps; for one held control x {figure(results.cost.held)}, with {controls + 1}"
        f" roll-outs beside UTC's {2 * controls + 1}",
        [results.cost.every_step > 1.0, results.cost.held > 1.0],
        "To convergence, by CasADi and IPOPT: `make bench-tools`.",
    )


def no_convergence_problems(results: PaperResults) -> Claim:
    """Steps without an answer, and steps in which the controller is stuck."""
    usual = {one.command for one in flown.CONFIGURATIONS.values()}
    cases = flown.all_cases()
    utc = {
        name
        for name in {one.scenario for one in cases.values()}
        if isinstance(shipped(name).controller, UtcSettings)
    }
    flights = {command: one for command, one in results.measures.items() if cases[command].scenario in utc}
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


def more_accurate(results: PaperResults) -> Claim:
    """Dynamics of alpha in the prediction."""
    unknown, modelled = rmse_of(results, [flown.M0_C2, flown.M1_C2])
    return decided(
        "With the dynamics of alpha in the prediction the accuracy is better (`utc_m0_c2`, `utc_m1_c2`)",
        "smaller RMSE",
        f"RMSE {figure(unknown)} unknown, {figure(modelled)} modelled",
        [modelled < unknown],
    )


def short_horizon(results: PaperResults) -> Claim:
    """and the horizon that they allow."""
    long, short, modelled = rmse_of(results, [flown.M0_C2, flown.M0_SHORT, flown.M1_C2])
    return decided(
        "and a smaller horizon can be used: 5 steps instead of 20",
        f"with 5 steps unknown dynamics are at least {CLEARLY} times worse than with 20, modelled ones are not worse",
        f"RMSE unknown {figure(long)} with 20 and {figure(short)} with 5, modelled {figure(modelled)} with 5",
        [short >= CLEARLY * long, modelled <= long],
    )


def fast_convergence(results: PaperResults) -> Claim:
    """The conclusion's first advantage."""
    found = [results.of(one).converged_at for one in flown.PAPER_UTC]
    return decided(
        "Fast convergence, around 2 s",
        f"inside 5 % for good from at most {flown.CONVERGED_S:g} s on",
        f"{listed(found)} s",
        [value <= flown.CONVERGED_S for value in found],
    )
