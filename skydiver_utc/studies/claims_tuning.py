# SPDX-License-Identifier: Apache-2.0
"""Claims about UTC's parameters: what each does and how much it matters."""

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

from skydiver_utc.studies import paper_cases as flown
from skydiver_utc.studies.claim import CLEARLY, Claim, decided, rmse_of
from skydiver_utc.studies.markdown import figure
from skydiver_utc.studies.paper_results import PaperResults

_BAR_WITHOUT_COUPLING = 15.0  # RMSE [deg/s]
_NEAR_BEST = 1.5  # times the best RMSE of a sweep


def of_tuning(results: PaperResults) -> Iterator[Claim]:
    """In the paper's order."""
    yield _p_err(results)
    yield _chosen_by_tuning(
        results, "The weight of the central point, W0 = 0.25, was chosen by tuning", flown.W0, (0.25, 0.25),
        "Another weight is better here.",
    )  # fmt: skip
    yield _chosen_by_tuning(
        results, "The horizon is a tuning parameter: 20 steps with alpha unknown, 5 with alpha modelled",
        flown.HORIZON, (20, 5), "Another horizon is better here.",
    )  # fmt: skip

    unknown, short, modelled = rmse_of(results, [flown.M0_C2, flown.M0_SHORT, flown.M1_C2])
    yield decided(
        "With the dynamics of alpha in the prediction the accuracy is better (`utc_m0_c2`, `utc_m1_c2`)",
        "smaller RMSE",
        f"RMSE {figure(unknown)} unknown, {figure(modelled)} modelled",
        [modelled < unknown],
    )
    yield decided(
        "and a smaller horizon can be used: 5 steps instead of 20",
        f"with 5 steps unknown dynamics are at least {CLEARLY} times worse than with 20, modelled ones are not worse",
        f"RMSE unknown {figure(unknown)} with 20 and {figure(short)} with 5, modelled {figure(modelled)} with 5",
        [short >= CLEARLY * unknown, modelled <= unknown],
    )

    by_rate, by_acceleration = hands(results)
    yield decided(
        "Qu gives qualitatively different solutions: the hands behave otherwise when coupled by the yaw rate (eq_q1,"
        " `utc_m1_c2`) and by the yaw acceleration (eq_q3, `utc_m1_c3`)",
        "correlation of both hands below -0.5 by the yaw rate (in turns), above 0.5 by the acceleration (together)",
        f"correlation {by_rate:.2f} and {by_acceleration:.2f}",
        [by_rate < -0.5, by_acceleration > 0.5],
    )

    q3, unknown_none, modelled_none = rmse_of(results, [flown.M0_C3, flown.M0_NONE, flown.M1_NONE])
    yield decided(
        "With alpha unknown, coupling by the yaw rate (eq_q1) is the most accurate, and coupling matters",
        f"better than by the yaw acceleration (eq_q3); no coupling at least {CLEARLY} times worse",
        f"RMSE {figure(unknown)} by the rate, {figure(q3)} by the acceleration, {figure(unknown_none)} without",
        [unknown < q3, unknown_none >= CLEARLY * unknown],
    )
    gaps = modelled_none - modelled, unknown_none - unknown
    ratios = modelled_none / modelled, unknown_none / unknown
    yield decided(
        "With modelled dynamics the correlation is less significant",
        "leaving it out costs less than with unknown dynamics, in deg/s and as a ratio",
        f"costs {figure(gaps[0])} deg/s (x {figure(ratios[0])}), unknown {figure(gaps[1])} (x {figure(ratios[1])})",
        [gaps[0] < gaps[1], ratios[0] < ratios[1]],
        "Less in one of the two counts only.",
    )
    largest = results.of(flown.M1_NONE).max_abs_error_deg_s
    yield decided(
        "and accurate tracking is achieved even if no correlation is assumed",
        f"RMSE at most {_BAR_WITHOUT_COUPLING:g} deg/s",
        f"RMSE {figure(modelled_none)}, largest error {figure(largest)} deg/s",
        [modelled_none <= _BAR_WITHOUT_COUPLING],
    )
    yield _least_effort(results)


def _p_err(results: PaperResults) -> Claim:
    found = [[results.of(one) for one in flown.P_ERR.cases(name)] for name in flown.SWEPT]
    accuracy = [_never_falls([one.rmse for one in row]) for row in found]
    thrift = [_never_falls([-one.effort for one in row]) and row[-1].effort < row[0].effort for row in found]
    ends = "; ".join(
        f"{name}: RMSE {figure(row[0].rmse)} to {figure(row[-1].rmse)}, effort {row[0].effort:.2f} to"
        f" {row[-1].effort:.2f}"
        for name, row in zip(flown.SWEPT.values(), found, strict=True)
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


def _chosen_by_tuning(
    results: PaperResults, words: str, sweep: flown.Sweep, chosen: tuple[float, float], why: str
) -> Claim:
    texts, near = [], []
    for (scenario, name), value in zip(flown.SWEPT.items(), chosen, strict=True):
        rmse = dict(zip(sweep.values, rmse_of(results, sweep.cases(scenario)), strict=True))
        best = min(rmse, key=rmse.__getitem__)
        texts.append(
            f"{name}: RMSE {figure(rmse[value])} at {value:g}, best {figure(rmse[best])} at {best:g}"
        )
        near.append(rmse[value] <= _NEAR_BEST * rmse[best])
    return decided(
        words, f"RMSE within {_NEAR_BEST} times the best of the sweep", "; ".join(texts), near, why
    )


def hands(results: PaperResults) -> tuple[float, float]:
    """Correlation of k_right and k_left under eq_q1 and eq_q3."""
    first, second = (results.of(one).hands_correlation or 0.0 for one in (flown.M1_C2, flown.M1_C3))
    return first, second


def _least_effort(results: PaperResults) -> Claim:
    q3 = results.of(flown.M1_C3)
    others = [
        results.of(one) for one in (flown.M0_C2, flown.M1_C2, flown.M0_C3, flown.M0_NONE, flown.M1_NONE)
    ]
    tracking = [one.effort for one in others if one.converged_at <= flown.CONVERGED_S]
    lazy = [one.effort for one in others if one.effort <= q3.effort]
    listed = ", ".join(f"{x:.2f}" for x in lazy)
    return decided(
        "The control effort is least with alpha modelled and the hands coupled by the yaw acceleration"
        " (`utc_m1_c3`)",
        f"least of the configurations, with and without coupling, that converge by {flown.CONVERGED_S:g} s",
        f"{q3.effort:.2f}; of those that converge {', '.join(f'{x:.2f}' for x in tracking)}",
        [q3.converged_at <= flown.CONVERGED_S and q3.effort < min(tracking, default=math.inf)],
        remark=f"Not the least of all: {listed} where the turn is not tracked by then." if lazy else "",
    )
