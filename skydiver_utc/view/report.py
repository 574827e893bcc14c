# SPDX-License-Identifier: Apache-2.0
"""One run, or several beside each other, as a page of one file that opens offline."""

import base64
import json
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib.resources import files
from string import Template
from typing import Any, NamedTuple

import numpy as np

from skydiver_utc.analysis import style
from skydiver_utc.analysis.figures import reach
from skydiver_utc.analysis.labels import facts, missing, rows
from skydiver_utc.analysis.numbers import SETTLING_S
from skydiver_utc.analysis.units import shown
from skydiver_utc.loop.outcome import Outcome
from skydiver_utc.loop.run import Run
from skydiver_utc.parameters import to_yaml
from skydiver_utc.studies.paper_words import paper_words
from skydiver_utc.view.player import has_bodies, player_page, poses_at
from skydiver_utc.view.scene import RUNS
from skydiver_utc.view.signals import charts
from skydiver_utc.view.stills import drawing, moments


class Flown(NamedTuple):
    """A run with its name on the page, its metrics, and the versions it was made with (may be empty)."""

    name: str
    run: Run
    metrics: dict[str, Any]
    versions: Mapping[str, str]


def report_html(flown: Sequence[Flown]) -> str:
    """The page of one run, or the comparison of several: at least one."""
    runs, first = [one.run for one in flown], flown[0].run
    alone = len(flown) == 1
    seen = [i for i, run in enumerate(runs) if has_bodies(run)]
    colours = [None if alone else RUNS[i % len(RUNS)] for i in seen]
    scenario, page = first.scenario, files("skydiver_utc.view")
    return Template((page / "report.html").read_text(encoding="utf-8")).substitute(
        title=escape(scenario.title or scenario.name if alone else " | ".join(one.name for one in flown)),
        sentence="<br>".join(escape(_sentence(one, alone)) for one in flown),
        remarks=_paragraphs(
            ("", scenario.description if alone else ""),
            *(("warn", missing(one.metrics)) for one in flown),
            *(("warn", one.metrics["reason"]) for one in flown if one.run.outcome is not Outcome.COMPLETED),
        ),
        stills=_stills(first) if alone and seen else "",
        metrics=_table(flown),
        heading="alone" if alone else "",
        columns="two" if seen else "",
        bodies='<iframe id="bodies" title="the bodies in 3-D"></iframe>' if seen else "",
        configuration="".join(_configuration(one, alone) for one in flown),
        scene=_json(player_page([runs[i] for i in seen], colours)) if seen else "",
        data=_json(_data(flown)),
        css=Template((page / "report.css").read_text(encoding="utf-8")).substitute(vars(style)),
        script=(page / "report.js").read_text(encoding="utf-8"),
    )


def _sentence(one: Flown, alone: bool) -> str:
    """The maneuver and its result."""
    run, scenario = one.run, one.run.scenario
    words = " and ".join(name.replace("_", " ") for name in run.tracked_names)
    control = (
        f"{words} tracked by {scenario.controller.kind}" if run.tracks_outputs else f"{words} flown open loop"
    )
    text = f"{control} for {run.time_s[-1] - run.time_s[0]:.3g} s: {'; '.join(facts(one.metrics))}."
    return f"{text[:1].upper()}{text[1:]}" if alone else f"{one.name}: {text}"


def _table(flown: Sequence[Flown]) -> str:
    """The metrics, one column for each run, beside the words of the paper where it has some."""
    found: dict[str, tuple[str, dict[int, str]]] = {}
    for i, one in enumerate(flown):
        for row in rows(one.metrics):
            found.setdefault(row.label, (row.unit, {}))[1][i] = row.text
    paper = paper_words(flown[0].run.scenario) if len(flown) == 1 else {}
    heads = [("", ""), *(("number", one.name if len(flown) > 1 else "") for one in flown), ("", "")]
    heads += [("", "the paper")] if paper else []
    lines = [_line("th", heads)] if any(text for _, text in heads) else []
    for label, (unit, texts) in found.items():
        cells = [("", label), *(("number", texts.get(i, "-")) for i in range(len(flown))), ("", unit)]
        said = next((words for part, words in paper.items() if part in label), "")
        lines.append(_line("td", cells + ([("", said)] if paper else [])))
    return f"<table>{''.join(lines)}</table>"


def _line(tag: str, cells: Iterable[tuple[str, str]]) -> str:
    line = "".join(f'<{tag} class="{kind}">{escape(text)}</{tag}>' for kind, text in cells)
    return f"<tr>{line}</tr>"


def _paragraphs(*texts: tuple[str, str]) -> str:
    return "".join(f'<p class="{kind}">{escape(text)}</p>' for kind, text in texts if text)


def _stills(run: Run) -> str:
    names = [shape.name.partition("_")[0] for shape in run.plant.shapes]
    colours = [name if name in ("left", "right") else "middle" for name in names]
    found = moments(run)
    poses = poses_at(run, np.array([run.time_s[one.row] for one in found]))
    return "".join(
        [
            '<div class="stills">',
            *(
                f'<button data-time="{run.time_s[one.row]:.6f}">{drawing(run.plant, pose, colours)}'
                f"{run.time_s[one.row]:.2f} s<br>{escape(one.words)}</button>"
                for one, pose in zip(found, poses, strict=True)
            ),
            "</div>",
        ]
    )


def _configuration(one: Flown, alone: bool) -> str:
    of = "" if alone else f" of {escape(one.name)}"
    versions = "".join(_line("td", [("", name), ("", str(value))]) for name, value in one.versions.items())
    return (
        f"<details><summary>Scenario{of}, with all settings</summary>"
        f"<pre>{escape(to_yaml(one.run.scenario))}</pre></details>"
    ) + (f"<details><summary>Versions{of}</summary><table>{versions}</table></details>" if versions else "")


def _data(flown: Sequence[Flown]) -> dict[str, Any]:
    """What the script draws, arrays as base64 of float32."""
    runs = [one.run for one in flown]
    found = charts(runs, [one.name for one in flown])
    for chart in found:
        for curve in chart["curves"]:
            curve |= {
                key: base64.b64encode(curve[key].astype("<f4").tobytes()).decode() for key in ("t", "y")
            }
        counts = chart["section"] == "Tracking" and min(run.time_s[0] for run in runs) < SETTLING_S
        chart["since"] = SETTLING_S if counts and max(run.time_s[-1] for run in runs) > SETTLING_S else -1.0
        chart["reach"] = _reach(runs, chart)
    return {
        "begin": min(run.time_s[0] for run in runs),
        "end": max(max(run.time_s[-1] for run in runs), runs[0].time_s[0] + runs[0].scenario.dt_s),
        "several": len(runs) > 1,
        "holes": [hole for one in flown for hole in one.metrics["holes_s"]],
        "charts": found,
    }


def _reach(runs: Sequence[Run], chart: Mapping[str, Any]) -> float | None:
    """Largest value on the axis of a tracked output, which a run that diverges would press flat; None for no bound."""
    if chart["section"] != "Tracking" or all(run.outcome is not Outcome.DIVERGED for run in runs):
        return None
    found = [
        reach(run, j)
        for run in runs
        for j, name in enumerate(run.tracked_names)
        if chart["title"].startswith(shown(run.plant, name).name)
    ]
    return max(found, default=None)


def _json(value: object) -> str:
    """JSON that ends no script."""
    return json.dumps(value, separators=(",", ":")).replace("<", "\\u003c")
