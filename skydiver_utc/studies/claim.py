"""What a claim is, and what deciding one needs."""

from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

from skydiver_utc.studies.markdown import figure
from skydiver_utc.studies.paper_results import PaperResults
from skydiver_utc.studies.paper_runs import M0_C2, M1_C2, M1_C3
from skydiver_utc.studies.runs import Measures, Run, shipped

CLEARLY = 1.5  # times worse, to count as clearly worse
PAPER_UTC = (M0_C2, M1_C2, M1_C3)


class Verdict(str, Enum):
    """What the measurement says of a claim."""

    HOLDS = "holds"
    PARTLY = "partly"
    FAILS = "does not hold"
    ELSEWHERE = "not measured here"


class Claim(NamedTuple):
    """The paper's words, the rule, what was measured, and what follows."""

    words: str
    rule: str
    measured: str
    verdict: Verdict


def judge(parts: Sequence[bool]) -> Verdict:
    """All parts hold, some, or none."""
    if all(parts):
        return Verdict.HOLDS
    return Verdict.PARTLY if any(parts) else Verdict.FAILS


def amplitude(one: Run) -> float:
    """Largest yaw rate wanted [deg/s]."""
    return shipped(one.scenario).reference.amplitude_or_level_deg_s


def rmse_of(results: PaperResults, runs: Sequence[Run]) -> list[float]:
    """RMSE of several runs [deg/s]."""
    return [results.of(one).rmse for one in runs]


def listed(values: Sequence[float]) -> str:
    """Several values, two digits each."""
    return ", ".join(figure(value) for value in values)


def effort(one: Measures) -> float:
    """Control effort for comparisons: infinite for a flight that has none."""
    return float("inf") if one.control_effort is None else one.control_effort
