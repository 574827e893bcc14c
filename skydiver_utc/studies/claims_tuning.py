# SPDX-License-Identifier: Apache-2.0
"""Claims about UTC's parameters: what each does and how much it matters."""

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise

from skydiver_utc.controllers.utc.settings import UtcSettings
from skydiver_utc.loop.registry import build_plant
from skydiver_utc.studies import paper_cases as flown
from skydiver_utc.studies.cases import shipped
from skydiver_utc.studies.claim import CLEARLY, Claim, Verdict, judge, listed, rmse_of
from skydiver_utc.studies.markdown import figure, percent
from skydiver_utc.studies.paper_results import PaperResults

_BAR_WITHOUT_COUPLING = 15.0  # RMSE [deg/s]
_ORDER_OF_MAGNITUDE = 0.1  # of an actuator's range
_NEAR_BEST = 1.5  # times the best RMSE of a sweep


def p_err(results: PaperResults) -> Claim:
    """What P_err trades."""
    found = [[results.of(one) for one in flown.P_ERR.cases(name)] for name in flown.SWEPT]
    accuracy = [_never_falls([one.rmse for one in row]) for row in found]
    thrift = [_never_falls([-one.effort for one in row]) for row in found]
    ends = "; ".join(
        f"`{name}`: RMSE {listed([one.rmse for one in row])}; effort {row[0].effort:.2f} to {row[-1].effort:.2f}"
        for name, row in zip(flown.SWEPT, found, strict=True)
    )
    return Claim(
        "P_err is the trade-off between accuracy and control effort",
        f"from {flown.P_ERR.values[0]:g} to {flown.P_ERR.values[-1]:g} the RMSE never falls, the effort never rises"
        " (within 5 %)",
        ends,
        judge([*accuracy, *thrift]),
    )


def _never_falls(values: Sequence[float]) -> bool:
    return all(after >= before - 0.05 * abs(before) for before, after in pairwise(values))


def w0(results: PaperResults) -> Claim:
    """The weight of the centre."""
    return _chosen_by_tuning(results, "W^0 = 0.25 was chosen by tuning", flown.W0, (0.25, 0.25))


def horizon(results: PaperResults) -> Claim:
    """The number of steps."""
    words = "The horizon is a tuning parameter: 20 steps with alpha unknown, 5 with eq:m1utc"
    return _chosen_by_tuning(results, words, flown.HORIZON, (20, 5))


def _chosen_by_tuning(
    results: PaperResults, words: str, sweep: flown.Sweep, chosen: tuple[float, float]
) -> Claim:
    texts, near = [], []
    for name, value in zip(flown.SWEPT, chosen, strict=True):
        rmse = dict(zip(sweep.values, rmse_of(results, sweep.cases(name)), strict=True))
        best = min(rmse, key=rmse.__getitem__)
        texts.append(
            f"`{name}`: {figure(rmse[value])} at {value:g}, best {figure(rmse[best])} at {best:g}, worst"
            f" {figure(max(rmse.values()))}"
        )
        near.append(rmse[value] <= _NEAR_BEST * rmse[best])
    return Claim(
        words, f"RMSE within {_NEAR_BEST} times the best of the sweep", "; ".join(texts), judge(near)
    )


def different_solutions(results: PaperResults) -> Claim:
    """What the coupling changes."""
    first, second = (results.of(one).hands_correlation or 0.0 for one in (flown.M1_C2, flown.M1_C3))
    return Claim(
        "Qu gives qualitatively different solutions: the hands behave otherwise with eq_q1 and eq_q3"
        " (`utc_m1_c2`, `utc_m1_c3`)",
        "correlation of k_right and k_left below -0.5 with eq_q1 (in turns), above 0.5 with eq_q3 (together)",
        f"{first:.2f} and {second:.2f}",
        judge([first < -0.5, second > 0.5]),
    )


def best_coupling(results: PaperResults) -> Claim:
    """Coupling with unknown dynamics."""
    q1, q3, none = rmse_of(results, [flown.M0_C2, flown.M0_C3, flown.M0_NONE])
    return Claim(
        "With alpha unknown, the coupling of eq_q1 is the most accurate, and coupling matters",
        f"eq_q1 better than eq_q3; no coupling at least {CLEARLY} times worse",
        f"eq_q1 {figure(q1)}, eq_q3 {figure(q3)}, none {figure(none)}",
        judge([q1 < q3, none >= CLEARLY * q1]),
    )


def coupling_matters_less(results: PaperResults) -> Claim:
    """Coupling with modelled dynamics."""
    unknown, unknown_none, modelled, modelled_none = rmse_of(
        results, [flown.M0_C2, flown.M0_NONE, flown.M1_C2, flown.M1_NONE]
    )
    return Claim(
        "With modelled dynamics the correlation is less significant",
        "leaving it out costs less than with unknown dynamics, in deg/s and as a ratio",
        f"{figure(modelled_none - modelled)} deg/s and x {figure(modelled_none / modelled)}, against"
        f" {figure(unknown_none - unknown)} deg/s and x {figure(unknown_none / unknown)}",
        judge(
            [
                modelled_none - modelled < unknown_none - unknown,
                modelled_none / modelled < unknown_none / unknown,
            ]
        ),
    )


def accurate_without(results: PaperResults) -> Claim:
    """and without any."""
    found = results.of(flown.M1_NONE)
    return Claim(
        "and accurate tracking is achieved even if no correlation is assumed",
        f"RMSE at most {_BAR_WITHOUT_COUPLING:g} deg/s",
        f"{figure(found.rmse)}, largest error {figure(found.max_abs_error_deg_s)}",
        judge([found.rmse <= _BAR_WITHOUT_COUPLING]),
    )


def least_effort(results: PaperResults) -> Claim:
    """What utc_m1_c3 is for."""
    q3, others = results.of(flown.M1_C3).effort, (flown.M0_C2, flown.M1_C2, flown.M0_C3)
    coupled = [results.of(one).effort for one in others]
    none = [results.of(one).effort for one in (flown.M0_NONE, flown.M1_NONE)]
    return Claim(
        "The control effort is least with eq:m1utc and eq_q3 (`utc_m1_c3`)",
        "least of the configurations with coupling, and of all",
        f"{q3:.2f}; with coupling {', '.join(f'{x:.2f}' for x in coupled)}; without"
        f" {', '.join(f'{x:.2f}' for x in none)}",
        judge([q3 < min(coupled), q3 < min(none)]),
    )


def insensitive(results: PaperResults) -> Claim:
    """The conclusion's second advantage."""
    words = "Not much sensitivity to the tuning: with reasonable covariances UTC always converges"
    rule = "every random tuning converges in the first half of the flight"
    if not results.tuning:
        return Claim(words, rule, "`skydiver-utc study tuning` into the same folder first", Verdict.ELSEWHERE)
    texts = [
        f"{one.label}: {one.converged} of {one.count} converge, {one.tracked} have an RMSE within 5 %,"
        f" {one.completed} stay belly to earth, half stay below {figure(one.rmse_quantiles[1])} deg/s"
        for one in results.tuning
    ]
    return Claim(words, rule, "; ".join(texts), judge([one.converged == one.count for one in results.tuning]))


def convenient(results: PaperResults) -> Claim:
    """The conclusion's third advantage."""
    scenario = shipped(flown.M0_C2.scenario)
    p, plant = scenario.controller, build_plant(scenario)
    assert isinstance(p, UtcSettings)
    assert isinstance(p.Pu, Mapping)
    assert p.coupling is not None
    deviations = [math.sqrt(p.Pu[name]) for name in plant.control_names]
    shares = [d / span for d, span in zip(deviations, plant.maximum - plant.minimum, strict=True)]
    sizes = (p.coupling.k_right, p.coupling.k_left, p.coupling.alpha)
    correlations = [size / deviations[0] / d for size, d in zip(sizes, deviations[1:], strict=True)]
    first, second = (results.of(one).hands_correlation or 0.0 for one in (flown.M1_C2, flown.M1_C3))
    return Claim(
        "Convenient tuning: the elements of Pu_0 and Qu have a clear physical meaning",
        "the numbers printed are standard deviations of a tenth of each actuator's range or more and correlations"
        " of at most 1; the signs do to the hands what they say",
        f"deviations {', '.join(percent(share) for share in shares)} of the ranges; correlations"
        f" {', '.join(f'{value:.1f}' for value in correlations)}, which no covariance has; hands {first:.2f} with"
        f" eq_q1, {second:.2f} with eq_q3",
        judge(
            [
                all(share >= _ORDER_OF_MAGNITUDE for share in shares),
                all(value <= 1.0 for value in correlations),
                first < -0.5 and second > 0.5,
            ]
        ),
    )
