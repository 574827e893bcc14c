# SPDX-License-Identifier: Apache-2.0
"""Claims of the paper's conclusion: UTC's advantages and the outlook on its stability."""

import math
from collections.abc import Iterator, Mapping

from skydiver_utc.controllers.utc.settings import UtcSettings
from skydiver_utc.loop.build import build_plant
from skydiver_utc.studies import paper_cases as flown
from skydiver_utc.studies.cases import shipped
from skydiver_utc.studies.claim import Claim, decided, listed
from skydiver_utc.studies.claims_theory import stability
from skydiver_utc.studies.claims_tuning import hands
from skydiver_utc.studies.markdown import percent
from skydiver_utc.studies.paper_results import PaperResults

_ORDER_OF_MAGNITUDE = 0.1  # of an actuator's range


def of_conclusion(results: PaperResults) -> Iterator[Claim]:
    """In the paper's order."""
    times = [results.of(one).converged_at for one in flown.PAPER_UTC]
    yield decided(
        "Fast convergence, around 2 s",
        f"inside 5 % for good from at most {flown.CONVERGED_S:g} s on",
        f"{listed(times)} s",
        [value <= flown.CONVERGED_S for value in times],
    )

    tuning = results.tuning
    names = (flown.UNKNOWN, flown.PI, flown.UNKNOWN_INSENSITIVE, flown.PI_INSENSITIVE)
    unknown, modelled, by_damping, modelled_by_damping = (
        percent(tuning[name].converged / tuning[name].count) for name in names
    )
    yield decided(
        "Not much sensitivity to the tuning: with reasonable covariances UTC always converges",
        "every random tuning, each covariance within a factor of 3, converges in the first half of the flight",
        f"{unknown} converge with alpha unknown, {modelled} with alpha modelled",
        [tuning[name].converged == tuning[name].count for name in (flown.UNKNOWN, flown.PI)],
        "While the turn slows down, the sign of alpha's coupling (eq:s14) reverses the gain of alpha. With the sign by"
        f" the damping left, a setting of this package, {by_damping} and {modelled_by_damping} converge"
        " (docs/findings.md).",
    )

    yield _convenient(results)
    yield stability()


def _convenient(results: PaperResults) -> Claim:
    scenario = shipped(flown.M0_C2.scenario)
    p, plant = scenario.controller, build_plant(scenario)
    assert isinstance(p, UtcSettings)
    assert isinstance(p.Pu, Mapping)
    assert p.coupling is not None
    deviations = [math.sqrt(p.Pu[name]) for name in plant.control_names]
    shares = [d / span for d, span in zip(deviations, plant.maximum - plant.minimum, strict=True)]
    sizes = (p.coupling.k_right, p.coupling.k_left, p.coupling.alpha)
    correlations = [size / deviations[0] / d for size, d in zip(sizes, deviations[1:], strict=True)]
    first, second = hands(results)
    signs = first < -0.5 and second > 0.5
    return decided(
        "Convenient tuning: the elements of Pu_0 and Qu have a clear physical meaning",
        "standard deviations of at least a tenth of each actuator's range, correlations of at most 1, and signs that"
        " do to the hands what they say",
        f"deviations {', '.join(percent(share) for share in shares)} of the ranges, correlations"
        f" {', '.join(f'{value:.1f}' for value in correlations)}; the signs do what they say:"
        f" {'yes' if signs else 'no'}",
        [
            all(share >= _ORDER_OF_MAGNITUDE for share in shares),
            all(value <= 1.0 for value in correlations),
            signs,
        ],
        "As printed the correlations exceed 1, which no covariance has; only the signs have the meaning.",
    )
