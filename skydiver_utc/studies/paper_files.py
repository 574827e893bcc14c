# SPDX-License-Identifier: Apache-2.0
"""The folder of a comparison: paper.md, details.md, results.json and the figures."""

import json
from collections.abc import Mapping
from pathlib import Path

from matplotlib.figure import Figure

from skydiver_utc.analysis.figures import tracking_figure
from skydiver_utc.analysis.study_figures import ErrorMap, error_maps
from skydiver_utc.analysis.style import png
from skydiver_utc.loop.run import Run
from skydiver_utc.parameters.files import write_file
from skydiver_utc.studies import paper_cases as flown
from skydiver_utc.studies.paper_page import details, page
from skydiver_utc.studies.paper_results import PaperResults
from skydiver_utc.studies.sensitivity import read_sensitivity
from skydiver_utc.studies.tuning_files import read_summaries

_RESULTS = "results.json"


def write_comparison(folder: Path, results: PaperResults, runs: Mapping[str, Run]) -> None:
    """Write all that the comparison made; the other studies' parts come from their files in the folder."""
    write_file(folder / _RESULTS, to_json(results))
    write_pages(folder)
    for label, run in runs.items():
        write_file(folder / f"{label}.png", png(tracking_figure(run)))
    write_file(folder / "sweeps.png", png(_sweeps(results)))


def write_pages(folder: Path) -> None:
    """Write both pages from the results in the folder."""
    results = read_comparison(folder)
    write_file(folder / "paper.md", page(results))
    write_file(folder / "details.md", details(results))


def read_comparison(folder: Path) -> PaperResults:
    """The results in a folder, with those of the other studies where they are there."""
    results = PaperResults.model_validate_json((folder / _RESULTS).read_bytes())
    return results.replace(tuning=read_summaries(folder), sensitivity=read_sensitivity(folder))


def to_json(results: PaperResults) -> str:
    """The results as text that `read_comparison` reads."""
    return json.dumps(results.model_dump(mode="json", exclude={"tuning", "sensitivity"}), indent=2) + "\n"


def _sweeps(results: PaperResults) -> Figure:
    panels = [
        ErrorMap(
            sweep.label,
            sweep.logarithmic,
            {
                name: (sweep.values, [results.of(one).rmse for one in sweep.cases(name)])
                for name in flown.SWEPT
            },
        )
        for sweep in flown.SWEEPS
    ]
    return error_maps(panels, "RMSE from 2 s on [deg/s]", bars=(), connected=True)
