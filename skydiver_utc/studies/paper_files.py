# SPDX-License-Identifier: Apache-2.0
"""The folder of a comparison: paper.md, details.md, results.json and the figures."""

import json
from pathlib import Path

from matplotlib.figure import Figure

from skydiver_utc.analysis.figures import tracking_figure
from skydiver_utc.analysis.study_figures import ErrorMap, error_maps
from skydiver_utc.analysis.style import png
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.parameters.files import write_file
from skydiver_utc.studies import paper_cases as flown
from skydiver_utc.studies.paper_page import details, page
from skydiver_utc.studies.paper_results import QUICK_S, PaperResults

_RESULTS = "results.json"


def write_comparison(folder: Path, results: PaperResults) -> None:
    """Write the results and all that is made of them; flies the runs of the paper's figures again."""
    write_file(folder / _RESULTS, to_json(results))
    write_file(folder / "paper.md", page(results))
    write_file(folder / "details.md", details(results))
    for label, one in flown.FIGURES.items():
        run = simulate(one.load(QUICK_S if results.quick else None))
        write_file(folder / f"{label}.png", png(tracking_figure(run)))
    write_file(folder / "sweeps.png", png(_sweeps(results)))


def read_comparison(folder: Path) -> PaperResults:
    """The results in a folder."""
    return PaperResults.model_validate_json((folder / _RESULTS).read_bytes())


def to_json(results: PaperResults) -> str:
    """The results as text that `read_comparison` reads."""
    return json.dumps(results.as_dict(), indent=2) + "\n"


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
