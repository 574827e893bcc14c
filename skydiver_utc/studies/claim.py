# SPDX-License-Identifier: Apache-2.0
"""A claim of the paper, and how it is decided."""

from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

from skydiver_utc.studies.cases import Case, shipped
from skydiver_utc.studies.markdown import figure
from skydiver_utc.studies.paper_results import PaperResults

CLEARLY = 1.5  # times worse, to count as clearly worse


class Verdict(str, Enum):
    """Whether a claim agrees with the measurements."""

    HOLDS = "holds"
    PARTLY = "partly"
    FAILS = "does not hold"


class Claim(NamedTuple):
    """The paper's words, the rule, what was measured, what follows, and why where it does not simply hold."""

    words: str
    rule: str
    measured: str
    verdict: Verdict
    why: str


def decided(
    words: str, rule: str, measured: str, parts: Sequence[bool], why: str = "", remark: str = ""
) -> Claim:
    """A claim that holds by all parts of its rule, by some, or by none; a reason where it does not, or a remark."""
    verdict = Verdict.HOLDS if all(parts) else Verdict.PARTLY if any(parts) else Verdict.FAILS
    return Claim(words, rule, measured, verdict, remark if verdict is Verdict.HOLDS else why or remark)


def amplitude(one: Case) -> float:
    """Largest yaw rate wanted [deg/s]."""
    return float(shipped(one.scenario).reference.amplitude_deg_s)


def rmse_of(results: PaperResults, cases: Sequence[Case]) -> list[float]:
    """RMSE of several cases [deg/s]."""
    return [results.of(one).rmse for one in cases]


def listed(values: Sequence[float]) -> str:
    """Several values, two digits each."""
    return ", ".join(figure(value) for value in values)
