"""The files of the tuning study: every flight, their summary, the figure."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import msgspec

from skydiver_utc.analysis.metrics import CONVERGED_SHARE
from skydiver_utc.parameters import Scenario
from skydiver_utc.studies.tuning import Tuning, to_csv
from skydiver_utc.studies.tuning_summary import TuningSummary

_SUMMARY = "tuning.json"


def write_study(
    folder: Path,
    scenarios: Mapping[str, Scenario],
    tunings: Mapping[str, Sequence[Tuning]],
    summaries: Mapping[str, TuningSummary],
) -> None:
    """Write tuning.csv, tuning.json and tuning.png."""
    from skydiver_utc.analysis.study_figures import Cloud, tuning_figure
    from skydiver_utc.analysis.style import png

    clouds = [
        Cloud(name, [one.measures.rmse for one in tunings[name]], summary.rank_correlation)
        for name, summary in summaries.items()
    ]
    amplitude = max(one.reference.amplitude_or_level_deg_s for one in scenarios.values())
    (folder / "tuning.csv").write_text(to_csv(tunings), encoding="utf-8")
    (folder / _SUMMARY).write_text(summaries_to_json(summaries), encoding="utf-8")
    (folder / "tuning.png").write_bytes(png(tuning_figure(clouds, CONVERGED_SHARE * amplitude)))


def summaries_to_json(summaries: Mapping[str, TuningSummary]) -> str:
    """The summaries by scenario, as text that `read_summaries` reads."""
    return msgspec.json.format(msgspec.json.encode(dict(summaries)), indent=2).decode() + "\n"


def read_summaries(folder: Path) -> dict[str, TuningSummary]:
    """The summaries that a study left in a folder, none where there was no study."""
    path = folder / _SUMMARY
    if not path.is_file():
        return {}
    return msgspec.json.decode(path.read_bytes(), type=dict[str, TuningSummary])
