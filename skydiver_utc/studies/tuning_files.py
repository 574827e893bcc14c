# SPDX-License-Identifier: Apache-2.0
"""The files of the tuning study: every run, their summary, the figure."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path

from pydantic import TypeAdapter

from skydiver_utc.analysis.metrics import CONVERGED_SHARE
from skydiver_utc.analysis.study_figures import tuning_figure
from skydiver_utc.analysis.style import png
from skydiver_utc.parameters.files import write_file
from skydiver_utc.studies.cases import amplitude_deg_s
from skydiver_utc.studies.markdown import figure, table
from skydiver_utc.studies.tuning import Tunings, TuningSummary, to_csv

_SUMMARY = "tuning.json"


def write_study(folder: Path, tunings: Sequence[Tunings], summaries: Sequence[TuningSummary]) -> None:
    """Write tuning.json, tuning.png, and each scenario's runs."""
    for one in tunings:
        write_file(folder / table_file(one.scenario.name, one.reach), to_csv(one))
    write_file(folder / _SUMMARY, summaries_to_json(summaries))
    rmse = {
        summary.label: [tuning.measures.rmse for tuning in one.random]
        for one, summary in zip(tunings, summaries, strict=True)
    }
    amplitude = max(amplitude_deg_s(one.scenario) for one in tunings)
    write_file(folder / "tuning.png", png(tuning_figure(rmse, CONVERGED_SHARE * amplitude)))


def table_file(scenario: str, reach: float) -> str:
    """Name of the table of a scenario's runs."""
    return f"tuning_{scenario}_{reach:g}.csv"


def summaries_to_json(summaries: Sequence[TuningSummary]) -> str:
    """The summaries as text that `read_summaries` reads."""
    return json.dumps([one.as_dict() for one in summaries], indent=2) + "\n"


def read_summaries(folder: Path) -> tuple[TuningSummary, ...]:
    """The summaries that a study left in a folder, none without one."""
    path = folder / _SUMMARY
    return TypeAdapter(tuple[TuningSummary, ...]).validate_json(path.read_bytes()) if path.is_file() else ()


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
