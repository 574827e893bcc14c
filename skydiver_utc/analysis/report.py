# SPDX-License-Identifier: Apache-2.0
"""One run as a page that can be sent by mail: metrics, figure, scenario and versions in a single file."""

import base64
from collections.abc import Mapping
from html import escape
from string import Template
from typing import Any

from skydiver_utc.analysis.labels import missing, rows
from skydiver_utc.loop.run import Run
from skydiver_utc.parameters import to_yaml

_PAGE = Template("""\
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>$title</title>
<style>
body { max-width: 62rem; margin: 2rem auto; padding: 0 1rem; color: #222;
       font: 16px/1.5 system-ui, sans-serif }
h1 { font-size: 1.5rem; margin-bottom: 0 }
table { border-collapse: collapse; margin: 1rem 0 }
td { padding: .15rem 1.2rem .15rem 0; border-bottom: 1px solid #ddd }
td.number { text-align: right; font-variant-numeric: tabular-nums }
img { width: 100%; height: auto }
pre { background: #f4f4f4; padding: 1rem; overflow-x: auto; font-size: .85rem }
</style>
</head>
<body>
<h1>$title</h1>
<p>$description</p>
<p><strong>$outcome</strong>: $reason</p>
$missing
<table>
$metrics
</table>
<img src="data:image/png;base64,$png"
     alt="outputs and reference, tracking error and controls over time">
<details><summary>Scenario, resolved</summary>
<pre>$scenario</pre>
</details>
$versions
</body>
</html>
""")


def report_html(run: Run, values: dict[str, Any], png: bytes, versions: Mapping[str, str]) -> str:
    """The page of a run from its metrics, its figure and the versions it was made with (may be empty)."""
    scenario = run.scenario
    return _PAGE.substitute(
        title=escape(scenario.title or scenario.name),
        description=escape(scenario.description),
        outcome=escape(values["outcome"].replace("_", " ")),
        reason=escape(values["reason"]),
        missing=f"<p><strong>{escape(missing(values))}</strong></p>" if missing(values) else "",
        metrics="\n".join(_row(row.label, row.text, row.unit) for row in rows(values)),
        png=base64.b64encode(png).decode("ascii"),
        scenario=escape(to_yaml(scenario)),
        versions=_versions(versions),
    )


def _row(label: str, text: str, unit: str) -> str:
    return f'<tr><td>{escape(label)}</td><td class="number">{escape(text)}</td><td>{escape(unit)}</td></tr>'


def _versions(versions: Mapping[str, str]) -> str:
    if not versions:
        return ""
    lines = "\n".join(f"<tr><td>{escape(n)}</td><td>{escape(str(v))}</td></tr>" for n, v in versions.items())
    return f"<details><summary>Versions</summary>\n<table>\n{lines}\n</table>\n</details>"
