# SPDX-License-Identifier: Apache-2.0
"""Every claim that the paper makes in words, in its order, beside what was measured."""

from skydiver_utc.studies.claim import Claim
from skydiver_utc.studies.claims_conclusion import of_conclusion
from skydiver_utc.studies.claims_plant import of_plant
from skydiver_utc.studies.claims_tracking import of_tracking
from skydiver_utc.studies.claims_tuning import of_tuning
from skydiver_utc.studies.paper_results import PaperResults


def checklist(results: PaperResults) -> list[Claim]:
    """All claims, decided."""
    return [*of_plant(results), *of_tracking(results), *of_tuning(results), *of_conclusion(results)]
