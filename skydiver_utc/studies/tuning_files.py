# SPDX-License-Identifier: Apache-2.0
"""The files of the tuning study: every run, their summary, the figure."""

import json
from collections.abc import Sequence
from pathlib import Path

from pydantic import TypeAdapter

from skydiver_utc.analysis.metrics import CONVERGED_SHARE
from skydiver_utc.analysis.study_figures import Cloud, tuning_figure
from skydiver_utc.analysis.style import png
from skydiver_utc.parameters.files import write_file
from skydiver_utc.studies.cases import amplitude_deg_s
from skydiver_utc.studies.tuning import Tunings, to_csv
from skydiver_utc.studies.tuning_summary import TuningSummary

_SUMMARY = "tuning.json"


def write_study(folder: Path, tunings: Sequence[Tunings], summaries: Sequence[TuningSummary]) -> None:
    """Write tuning.json, tuning.png, and each scenario's runs."""
    for one in tunings:
        write_file(folder / table_file(one.scenario.name, one.reach), to_csv(one))
    write_file(folder / _SUMMARY, summaries_to_json(summaries))
    clouds = [
        Cloud(
            summary.label,
            k % 2,
            k // 2,
            [tuning.measures.rmse for tuning in one.random],
            summary.influence,
        )
        for k, (one, summary) in enumerate(zip(tunings, summaries, strict=True))
    ]
    amplitude = max(amplitude_deg_s(one.scenario) for one in tunings)
    write_file(folder / "tuning.png", png(tuning_figure(clouds, CONVERGED_SHARE * amplitude)))


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
