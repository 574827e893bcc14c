# SPDX-License-Identifier: Apache-2.0
"""Every claim that the paper makes in words, in its order, beside what was measured."""

from collections.abc import Callable

from skydiver_utc.studies import claims_plant, claims_theory, claims_tracking, claims_tuning
from skydiver_utc.studies.claim import Claim
from skydiver_utc.studies.paper_results import PaperResults

_CLAIMS: tuple[Callable[[PaperResults], Claim], ...] = (
    claims_plant.linear_control,
    claims_plant.pose_fails,
    claims_plant.posture_alone,
    claims_plant.hands_needed,
    claims_plant.hands_turn,
    claims_tracking.tracks,
    claims_tracking.layouts,
    claims_theory.mean_square,
    claims_tracking.cheaper,
    claims_tracking.no_convergence_problems,
    claims_tracking.not_parameterised,
    claims_tuning.p_err,
    claims_tuning.w0,
    claims_tuning.horizon,
    claims_tracking.more_accurate,
    claims_tracking.short_horizon,
    claims_tuning.different_solutions,
    claims_tuning.best_coupling,
    claims_tuning.coupling_matters_less,
    claims_tuning.accurate_without,
    claims_tuning.least_effort,
    claims_tracking.fast_convergence,
    claims_tuning.insensitive,
    claims_tuning.convenient,
    claims_theory.stability,
)


def checklist(results: PaperResults) -> list[Claim]:
    """All claims, decided."""
    return [claim(results) for claim in _CLAIMS]
