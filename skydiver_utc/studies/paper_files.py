# SPDX-License-Identifier: Apache-2.0
"""The folder of a comparison: paper.md, results.json and the figures."""

import json
import math
from collections.abc import Mapping
from pathlib import Path

from matplotlib.figure import Figure

from skydiver_utc.analysis.figures import tracking_figure
from skydiver_utc.analysis.study_figures import Curve, Panel, sweeps_figure
from skydiver_utc.analysis.style import png
from skydiver_utc.loop.run import Run
from skydiver_utc.studies import paper_cases as flown
from skydiver_utc.studies.cases import shipped
from skydiver_utc.studies.paper_page import page
from skydiver_utc.studies.paper_results import PaperResults
from skydiver_utc.studies.tuning_files import read_summaries

_RESULTS, _PAGE = "results.json", "paper.md"


def write_comparison(folder: Path, results: PaperResults, runs: Mapping[str, Run]) -> None:
    """Write all that the comparison made, with the tuning study's part of the page from its file in the folder."""
    (folder / _RESULTS).write_text(to_json(results), encoding="utf-8")
    (folder / _PAGE).write_text(page(read_comparison(folder)), encoding="utf-8")
    for label, run in runs.items():
        (folder / f"{label}.png").write_bytes(png(tracking_figure(run)))
    (folder / "sweeps.png").write_bytes(png(_sweeps(results)))


def read_comparison(folder: Path) -> PaperResults:
    """The results in a folder, with those of the tuning study where it is there."""
    results = PaperResults.model_validate_json((folder / _RESULTS).read_bytes())
    return results.replace(tuning=read_summaries(folder))


def to_json(results: PaperResults) -> str:
    """The results as text that `read_comparison` reads."""
    return json.dumps(results.model_dump(mode="json", exclude={"tuning"}), indent=2) + "\n"


def _sweeps(results: PaperResults) -> Figure:
    panels = []
    for sweep in flown.SWEEPS:
        curves, chosen = [], []
        for scenario in flown.SWEPT:
            found = [results.of(one) for one in sweep.cases(scenario)]
            effort = [one.effort if math.isfinite(one.effort) else math.nan for one in found]
            curves.append(Curve(scenario, [one.rmse for one in found], effort))
            chosen.append(getattr(shipped(scenario).controller, sweep.setting.partition(".")[2]))
        panels.append(Panel(sweep.label, sweep.values, sweep.logarithmic, sweep.ticks, chosen, curves))
    return sweeps_figure(panels)
