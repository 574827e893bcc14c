# SPDX-License-Identifier: Apache-2.0
"""The report of a study: tables and figures in Markdown, and all runs as one table."""

import csv
import io
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from skydiver_utc.analysis.labels import label_of
from skydiver_utc.analysis.study_figures import ErrorMap, error_maps
from skydiver_utc.analysis.style import png
from skydiver_utc.parameters.files import write_file
from skydiver_utc.studies.design import own_value, problem, salib
from skydiver_utc.studies.flights import Plan
from skydiver_utc.studies.intervals import median_interval, share_interval
from skydiver_utc.studies.ledger import FAILED, Row
from skydiver_utc.studies.markdown import figure, percent, table
from skydiver_utc.studies.study import Bar

REPORT, FIGURE = "report.md", "maps.png"
_MOST_FAILURES = 20


def write_report(folder: Path, plan: Plan, rows: Sequence[Row]) -> None:
    """Write report.md, maps.png and runs.csv."""
    _write_runs(folder, plan, rows)
    metric = next(iter(plan.study.success), plan.study.metrics[0])
    panels = maps_of(plan, rows, metric)
    if panels:
        bar = plan.study.success.get(metric)
        bars = [side for side in (bar.at_least, bar.at_most) if side is not None] if bar else []
        figure = error_maps(panels, label_of(metric), bars, plan.study.sampler == "one_by_one")
        write_file(folder / FIGURE, png(figure))
    write_file(folder / REPORT, report(plan, rows, bool(panels)))


def report(plan: Plan, rows: Sequence[Row], with_figure: bool) -> str:
    """The report as Markdown."""
    study = plan.study
    bars = [f"{name} {_limits(bar)}" for name, bar in study.success.items()]
    cpu_s = sum(row.cpu_s for row in rows)
    parts = [
        f"# {study.title or study.name}",
        study.description,
        f"{len(rows)} runs, {cpu_s:.0f} s of CPU time, {cpu_s / max(len(rows), 1):.2f} s each; seed {study.seed}."
        f" A success is completed{''.join(f', {bar}' for bar in bars)}. Shares with Wilson's 95 % interval,"
        " medians of the completed runs with a bootstrap's.",
        cases_table(plan, rows),
    ]
    if study.sampler == "one_by_one":
        parts += [
            "## Values borne",
            "Each alone: every run between these two values is a success.",
            borne_table(plan, rows),
        ]
    else:
        parts += [f"## Sensitivity of {study.metrics[0]}", sensitivity_table(plan, rows)]
    if with_figure:
        parts += [f"![The metric of success against each value, dashed: the bar of a success]({FIGURE})"]
    if failures := [row for row in rows if row.outcome == FAILED]:
        shown = [(str(row.number), row.case, row.sentence) for row in failures[:_MOST_FAILURES]]
        parts += [f"## {len(failures)} runs failed", table(("run", "case", "error"), shown)]
    return "\n\n".join(part.strip() for part in parts if part) + "\n"


def _limits(bar: Bar) -> str:
    low, high = bar.at_least, bar.at_most
    sides = [f"at least {low:g}" if low is not None else "", f"at most {high:g}" if high is not None else ""]
    return " and ".join(filter(None, sides))


def cases_table(plan: Plan, rows: Sequence[Row]) -> str:
    """Runs, outcomes, share of successes and median metrics of each case."""
    numeric = [name for name in plan.study.metrics if any(_is_number(row.metrics.get(name)) for row in rows)]
    lines = []
    for case in plan.scenarios:
        own = [row for row in rows if row.case == case]
        if not own:
            continue
        count = sum(row.success for row in own)
        low, high = share_interval(count, len(own))
        ends = Counter(row.outcome for row in own if row.outcome != "completed")
        medians = []
        for name in numeric:
            values = [
                row.metrics[name]
                for row in own
                if row.outcome == "completed" and _is_number(row.metrics[name])
            ]
            middle, least, most = median_interval(values)
            medians.append(f"{figure(middle)} ({figure(least)} to {figure(most)})" if values else "-")
        lines.append(
            (case, str(len(own)), f"{percent(count / len(own))} ({100 * low:.0f} to {100 * high:.0f})",
             ", ".join(f"{n} {end}" for end, n in sorted(ends.items())) or "-", *medians)
        )  # fmt: skip
    return table(("case", "runs", "success", "not completed", *numeric), lines)


def borne_table(plan: Plan, rows: Sequence[Row]) -> str:
    """For each variation and case the values about the scenario's own between which every run is a success."""
    flown = Counter(row.case for row in rows)
    lines = [("runs of each error", *(str(flown[case] // len(plan.study.vary)) for case in plan.scenarios))]
    for name, one in plan.study.vary.items():
        cells = []
        for case in plan.scenarios:
            own = [(row.sample[name], row.success) for row in rows if row.case == case and name in row.sample]
            cells.append(borne(own, own_value(one, plan.own[case])))
        lines.append((f"{name} [{one.unit or '1'}]", *cells))
    return table(("", *plan.scenarios), lines)


def borne(runs: Sequence[tuple[Any, bool]], own: float | None) -> str:
    """The values next to the own one between which every run (value, success) is a success."""
    if own is None or not runs or not all(_is_number(value) for value, _ in runs):
        return "-"
    ends = []
    for side in (-1.0, 1.0):
        reached: float | None = None
        for value, success in sorted(runs, key=lambda run: side * run[0]):
            if side * (value - own) >= 0.0:
                if not success:
                    break
                reached = value
        ends.append(reached)
    if ends == [None, None]:
        return "none"
    low, high = (own if end is None else end for end in ends)
    whole = low <= min(value for value, _ in runs) and high >= max(value for value, _ in runs)
    return f"{low:.3g} to {high:.3g}" + (" (all)" if whole else "")


def maps_of(plan: Plan, rows: Sequence[Row], metric: str) -> list[ErrorMap]:
    """A metric of each case's runs against each of the variations that are numbers."""
    panels = []
    for name, one in plan.study.vary.items():
        found: dict[str, Any] = {}
        for case in plan.scenarios:
            own = ((row.sample.get(name), row.metrics.get(metric)) for row in rows if row.case == case)
            if points := sorted(point for point in own if all(map(_is_number, point))):
                found[case] = tuple(zip(*points, strict=True))
        if found:
            panels.append(ErrorMap(f"{name} [{one.unit or '1'}]", one.log_uniform is not None, found))
    return panels


def sensitivity_table(plan: Plan, rows: Sequence[Row]) -> str:
    """Indices of each variation for the first metric, by case; runs without it make a case's undefined.

    SALib's first and total order (sobol), mean and deviation of elementary effects (morris), else Spearman's rank
    correlation, in which a run without the metric counts as the largest; "-" where there is none.
    """
    study = plan.study
    shown = {"sobol": ("S1", "ST"), "morris": ("mu_star", "sigma")}.get(study.sampler, ("rank correlation",))
    lines = []
    for case in plan.scenarios:
        own = [row for row in rows if row.case == case]
        measured = (row.metrics.get(study.metrics[0]) for row in own)
        found = np.array([value if _is_number(value) else np.inf for value in measured])
        indices = _indices(plan, own, found)
        for k, name in enumerate(study.vary):
            values = (indices[index][k] if indices else np.nan for index in shown)
            lines.append((case, name, *("-" if np.isnan(value) else f"{value:.2f}" for value in values)))
    return table(("case", "", *shown), lines)


def _indices(plan: Plan, rows: Sequence[Row], found: Any) -> Any:
    """By name, the indices of the variations; None where they are undefined."""
    study, points = plan.study, plan.design.table
    if not study.by_salib:
        drawn = ([row.sample[name] for row in rows] for name in study.vary)
        return {"rank correlation": [_rank_correlation(values, found) for values in drawn]}
    if len(found) < len(points) or not np.isfinite(found).all():
        return None
    if study.sampler == "sobol":
        return salib("analyze.sobol").analyze(problem(study), found, calc_second_order=False, seed=study.seed)
    return salib("analyze.morris").analyze(problem(study), points, found, seed=study.seed)


def _rank_correlation(values: Sequence[Any], found: Any) -> float:
    """Spearman's; NaN where there are no numbers or nothing varies."""
    from scipy.stats import spearmanr

    if not all(map(_is_number, values)) or min(len(set(values)), len(set(found))) < 2:
        return np.nan
    return float(spearmanr(values, found).statistic)


def _write_runs(folder: Path, plan: Plan, rows: Sequence[Row]) -> None:
    varied, metrics = list(plan.study.vary), plan.study.metrics
    columns = ["number", "case", *varied, "outcome", "success", *metrics, "sentence", "cpu_s"]
    records = [
        [row.number, row.case, *map(row.sample.get, varied), row.outcome, row.success,
         *map(row.metrics.get, metrics), row.sentence, row.cpu_s]
        for row in rows
    ]  # fmt: skip
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([columns, *records])
    write_file(folder / "runs.csv", text.getvalue())


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
