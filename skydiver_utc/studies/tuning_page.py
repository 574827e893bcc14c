# SPDX-License-Identifier: Apache-2.0
"""The tuning study in tables."""

from collections.abc import Callable, Sequence

from skydiver_utc.studies.markdown import figure, table
from skydiver_utc.studies.tuning_summary import TuningSummary

_COUNTS: dict[str, Callable[[TuningSummary], str]] = {
    "tunings": lambda one: str(one.count),
    "belly to earth to the end": lambda one: str(one.completed),
    "converged in the first half": lambda one: str(one.converged),
    "converged by 2 s": lambda one: str(one.converged_by_2_s),
    "RMSE at most 5 % of the amplitude": lambda one: str(one.tracked),
    "RMSE that 5 %, 50 %, 95 % stay below": lambda one: ", ".join(map(figure, one.rmse_quantiles)),
    "RMSE of the scenario's own tuning": lambda one: figure(one.own_rmse),
    "tunings with a smaller RMSE": lambda one: str(one.better_than_own),
    "steps without a solution": lambda one: str(one.kept_previous_steps),
}


def head(summaries: Sequence[TuningSummary]) -> list[str]:
    """The columns of both tables."""
    return ["", *(one.label for one in summaries)]


def count_rows(summaries: Sequence[TuningSummary]) -> list[list[str]]:
    """Shares of the tunings by outcome."""
    return [[label, *(text(one) for one in summaries)] for label, text in _COUNTS.items()]


def influence_rows(summaries: Sequence[TuningSummary]) -> list[list[str]]:
    """Rank correlation of each factor with the RMSE."""
    return [[name, *(f"{one.influence[name]:+.2f}" for one in summaries)] for name in summaries[0].influence]


def tuning_section(summaries: Sequence[TuningSummary]) -> str:
    """The study's part of the page."""
    if not summaries:
        return "## Random tunings\n\nNot run: `skydiver-utc study tuning` into the same folder first.\n"
    return f"""## Random tunings

Each covariance times a random factor, log-uniform within the bound named (`skydiver-utc study tuning`); insensitive:
with the sign of alpha's coupling by the damping. Every run is a row of a
tuning_*.csv beside this page, with its factors.

{table(head(summaries), count_rows(summaries))}
Rank correlation of each factor with the RMSE:

{table(head(summaries), influence_rows(summaries))}
![RMSE of the random tunings](tuning.png)
"""
