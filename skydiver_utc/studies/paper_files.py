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


def write_comparison(folder: Path, results: PaperResults) -> None:
    """Write the results and all that is made of them; flies the runs of the paper's figures again."""
    write_file(folder / "results.json", json.dumps(results.as_dict(), indent=2) + "\n")
    write_file(folder / "paper.md", page(results))
    write_file(folder / "details.md", details(results))
    for label, one in flown.FIGURES.items():
        run = simulate(one.load(QUICK_S if results.quick else None))
        write_file(folder / f"{label}.png", png(tracking_figure(run)))
    write_file(folder / "sweeps.png", png(_sweeps(results)))


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
