# SPDX-License-Identifier: Apache-2.0
"""Claims about UTC's parameters: what each does and how much it matters."""

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise

from skydiver_utc.controllers.utc.settings import UtcSettings
from skydiver_utc.loop.build import build_plant
from skydiver_utc.studies import paper_cases as flown
from skydiver_utc.studies.cases import shipped
from skydiver_utc.studies.claim import CLEARLY, Claim, decided, judge, rmse_of
from skydiver_utc.studies.markdown import figure, percent
from skydiver_utc.studies.paper_results import PaperResults

_BAR_WITHOUT_COUPLING = 15.0  # RMSE [deg/s]
_ORDER_OF_MAGNITUDE = 0.1  # of an actuator's range
_NEAR_BEST = 1.5  # times the best RMSE of a sweep
_SWEPT = ("alpha unknown", "alpha modelled")  # flown.SWEPT in words


def p_err(results: PaperResults) -> Claim:
    """Claims on P_err."""
    found = [[results.of(one) for one in flown.P_ERR.cases(name)] for name in flown.SWEPT]
    accuracy = [_never_falls([one.rmse for one in row]) for row in found]
    thrift = [_never_falls([-one.effort for one in row]) and row[-1].effort < row[0].effort for row in found]
    ends = "; ".join(
        f"{name}: RMSE {figure(row[0].rmse)} to {figure(row[-1].rmse)}, effort {row[0].effort:.2f} to"
        f" {row[-1].effort:.2f}"
        for name, row in zip(_SWEPT, found, strict=True)
    )
    return decided(
        "P_err is the trade-off between accuracy and control effort",
        f"from {flown.P_ERR.values[0]:g} to {flown.P_ERR.values[-1]:g} the RMSE never falls, the effort never rises"
        " (within 5 %) and is less at the end",
        ends,
        [*accuracy, *thrift],
        "A large P_err costs accuracy; the effort hardly changes, because the bounds hold the controls.",
    )


def _never_falls(values: Sequence[float]) -> bool:
    return all(after >= before - 0.05 * abs(before) for before, after in pairwise(values))


def w0(results: PaperResults) -> Claim:
    """The weight of the centre."""
    words = "The weight of the central point, W0 = 0.25, was chosen by tuning"
    return _chosen_by_tuning(results, words, flown.W0, (0.25, 0.25), "Another weight is better here.")


def horizon(results: PaperResults) -> Claim:
    """The number of steps."""
    words = "The horizon is a tuning parameter: 20 steps with alpha unknown, 5 with alpha modelled"
    return _chosen_by_tuning(results, words, flown.HORIZON, (20, 5), "Another horizon is better here.")


def _chosen_by_tuning(
    results: PaperResults, words: str, sweep: flown.Sweep, chosen: tuple[float, float], why: str
) -> Claim:
    texts, near = [], []
    for scenario, name, value in zip(flown.SWEPT, _SWEPT, chosen, strict=True):
        rmse = dict(zip(sweep.values, rmse_of(results, sweep.cases(scenario)), strict=True))
        best = min(rmse, key=rmse.__getitem__)
        texts.append(
            f"{name}: RMSE {figure(rmse[value])} at {value:g}, best {figure(rmse[best])} at {best:g}"
        )
        near.append(rmse[value] <= _NEAR_BEST * rmse[best])
    return decided(
        words, f"RMSE within {_NEAR_BEST} times the best of the sweep", "; ".join(texts), near, why
    )


def different_solutions(results: PaperResults) -> Claim:
    """Claims on the coupling."""
    first, second = _hands(results)
    return decided(
        "Qu gives qualitatively different solutions: the hands behave otherwise when coupled by the yaw rate (eq_q1,"
        " `utc_m1_c2`) and by the yaw acceleration (eq_q3, `utc_m1_c3`)",
        "correlation of both hands below -0.5 by the yaw rate (in turns), above 0.5 by the acceleration (together)",
        f"correlation {first:.2f} and {second:.2f}",
        [first < -0.5, second > 0.5],
    )


def _hands(results: PaperResults) -> tuple[float, float]:
    """Correlation of k_right and k_left under eq_q1 and eq_q3."""
    first, second = (results.of(one).hands_correlation or 0.0 for one in (flown.M1_C2, flown.M1_C3))
    return first, second


def best_coupling(results: PaperResults) -> Claim:
    """Coupling with unknown dynamics."""
    q1, q3, none = rmse_of(results, [flown.M0_C2, flown.M0_C3, flown.M0_NONE])
    return decided(
        "With alpha unknown, coupling by the yaw rate (eq_q1) is the most accurate, and coupling matters",
        f"better than by the yaw acceleration (eq_q3); no coupling at least {CLEARLY} times worse",
        f"RMSE {figure(q1)} by the rate, {figure(q3)} by the acceleration, {figure(none)} without",
        [q1 < q3, none >= CLEARLY * q1],
    )


def coupling_matters_less(results: PaperResults) -> Claim:
    """Coupling with modelled dynamics."""
    unknown, unknown_none, modelled, modelled_none = rmse_of(
        results, [flown.M0_C2, flown.M0_NONE, flown.M1_C2, flown.M1_NONE]
    )
    gaps = modelled_none - modelled, unknown_none - unknown
    ratios = modelled_none / modelled, unknown_none / unknown
    return decided(
        "With modelled dynamics the correlation is less significant",
        "leaving it out costs less than with unknown dynamics, in deg/s and as a ratio",
        f"costs {figure(gaps[0])} deg/s (x {figure(ratios[0])}), unknown {figure(gaps[1])} (x {figure(ratios[1])})",
        [gaps[0] < gaps[1], ratios[0] < ratios[1]],
        "Less in one of the two counts only.",
    )


def accurate_without(results: PaperResults) -> Claim:
    """and without any."""
    found = results.of(flown.M1_NONE)
    return decided(
        "and accurate tracking is achieved even if no correlation is assumed",
        f"RMSE at most {_BAR_WITHOUT_COUPLING:g} deg/s",
        f"RMSE {figure(found.rmse)}, largest error {figure(found.max_abs_error_deg_s)} deg/s",
        [found.rmse <= _BAR_WITHOUT_COUPLING],
    )


def least_effort(results: PaperResults) -> Claim:
    """Claims on utc_m1_c3."""
    q3 = results.of(flown.M1_C3)
    others = [
        results.of(one) for one in (flown.M0_C2, flown.M1_C2, flown.M0_C3, flown.M0_NONE, flown.M1_NONE)
    ]
    tracking = [one.effort for one in others if one.converged_at <= flown.CONVERGED_S]
    of_all = q3.effort < min(one.effort for one in others)
    lazy = [one.effort for one in others if one.effort <= q3.effort]
    return Claim(
        "The control effort is least with alpha modelled and the hands coupled by the yaw acceleration"
        " (`utc_m1_c3`)",
        f"least of the configurations, with and without coupling, that converge by {flown.CONVERGED_S:g} s",
        f"{q3.effort:.2f}; of those that converge {', '.join(f'{x:.2f}' for x in tracking)}",
        judge([q3.converged_at <= flown.CONVERGED_S and q3.effort < min(tracking, default=math.inf)]),
        ""
        if of_all
        else f"Not the least of all: {', '.join(f'{x:.2f}' for x in lazy)} where the turn is not tracked by then.",
    )


def insensitive(results: PaperResults) -> Claim:
    """The conclusion's second advantage."""
    found = results.tuning
    names = (flown.UNKNOWN, flown.PI, flown.UNKNOWN_INSENSITIVE, flown.PI_INSENSITIVE)
    unknown, modelled, by_damping, modelled_by_damping = (
        percent(found[name].converged / found[name].count) for name in names
    )
    return decided(
        "Not much sensitivity to the tuning: with reasonable covariances UTC always converges",
        "every random tuning, each covariance within a factor of 3, converges in the first half of the flight",
        f"{unknown} converge with alpha unknown, {modelled} with alpha modelled",
        [found[name].converged == found[name].count for name in (flown.UNKNOWN, flown.PI)],
        "While the turn slows down, the sign of alpha's coupling (eq:s14) reverses the gain of alpha. With the sign by"
        f" the damping left, a setting of this package, {by_damping} and {modelled_by_damping} converge"
        " (docs/findings.md).",
    )


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
    first, second = _hands(results)
    return decided(
        "Convenient tuning: the elements of Pu_0 and Qu have a clear physical meaning",
        "standard deviations of at least a tenth of each actuator's range, correlations of at most 1, and signs that"
        " do to the hands what they say",
        f"deviations {', '.join(percent(share) for share in shares)} of the ranges, correlations"
        f" {', '.join(f'{value:.1f}' for value in correlations)}; the signs do what they say:"
        f" {'yes' if first < -0.5 and second > 0.5 else 'no'}",
        [
            all(share >= _ORDER_OF_MAGNITUDE for share in shares),
            all(value <= 1.0 for value in correlations),
            first < -0.5 and second > 0.5,
        ],
        "As printed the correlations exceed 1, which no covariance has; only the signs have the meaning.",
    )
