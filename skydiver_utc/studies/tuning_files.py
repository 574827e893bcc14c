"""The files of the tuning study: every flight, their summary, the figure."""

from collections.abc import Sequence
from pathlib import Path

import msgspec

from skydiver_utc.analysis.metrics import CONVERGED_SHARE
from skydiver_utc.analysis.study_figures import Cloud, tuning_figure
from skydiver_utc.analysis.style import png
from skydiver_utc.studies.tuning import Tunings, to_csv
from skydiver_utc.studies.tuning_summary import TuningSummary

_SUMMARY = "tuning.json"


def write_study(folder: Path, tunings: Sequence[Tunings], summaries: Sequence[TuningSummary]) -> None:
    """Write tuning.json, tuning.png, and each scenario's flights."""
    for one in tunings:
        (folder / flights_file(one.scenario.name, one.reach)).write_text(to_csv(one), encoding="utf-8")
    (folder / _SUMMARY).write_text(summaries_to_json(summaries), encoding="utf-8")
    scenarios = list(dict.fromkeys(one.scenario for one in summaries))
    reaches = list(dict.fromkeys(one.reach for one in summaries))
    clouds = [
        Cloud(
            summary.label,
            scenarios.index(summary.scenario),
            reaches.index(summary.reach),
            [tuning.measures.rmse for tuning in one.random],
            {name: influence.rank_correlation for name, influence in summary.influence.items()},
        )
        for one, summary in zip(tunings, summaries, strict=True)
    ]
    amplitude = max(one.scenario.reference.amplitude_or_level_deg_s for one in tunings)
    (folder / "tuning.png").write_bytes(png(tuning_figure(clouds, CONVERGED_SHARE * amplitude)))


def flights_file(scenario: str, reach: float) -> str:
    """Name of the table of a scenario's flights."""
    return f"tuning_{scenario}_{reach:g}.csv"


def summaries_to_json(summaries: Sequence[TuningSummary]) -> str:
    """The summaries as text that `read_summaries` reads."""
    return msgspec.json.format(msgspec.json.encode(list(summaries)), indent=2).decode() + "\n"


def read_summaries(folder: Path) -> list[TuningSummary]:
    """The summaries that a study left in a folder, none where there was no study."""
    path = folder / _SUMMARY
    return msgspec.json.decode(path.read_bytes(), type=list[TuningSummary]) if path.is_file() else []
