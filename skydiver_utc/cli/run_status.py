# SPDX-License-Identifier: Apache-2.0
"""The state of runs over ROS on one screen; plain lines where stderr is no terminal."""

import time
from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.live import Live
from rich.table import Table
from rich.text import Text
from typing_extensions import Self

from skydiver_utc.analysis.units import shown
from skydiver_utc.cli.errors import printable
from skydiver_utc.cli.screen import table
from skydiver_utc.loop.build import build_reference
from skydiver_utc.parameters import Scenario
from skydiver_utc.parameters.registry import factory
from skydiver_utc.references.live import Live as LiveReference

_COLUMNS = ("run", "phase", "simulated", "rate", "error", "controls", "late answers")
# Between two plain lines of a run; the first of them, so that a short run has none.
LINE_PERIOD_S = 10.0


class RunStatus:
    """Phase, simulated time, rate, error, controls and late answers of each run, from the reports of its plant."""

    def __init__(self, scenarios: Mapping[str, Scenario], quiet: bool) -> None:
        self._console = Console(stderr=True, quiet=quiet)
        self._runs = {name: _Run(name, scenario) for name, scenario in scenarios.items()}
        self._on_screen = self._console.is_terminal and not quiet
        self._live = Live(
            console=self._console, transient=True, refresh_per_second=8, get_renderable=self._table
        )

    def __enter__(self) -> Self:
        if self._on_screen:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._live.stop()

    def show(self, name: str, report: Mapping[str, Any]) -> None:
        """Take in a report of a run's plant."""
        run = self._runs[name]
        run.receive(report)
        if not self._on_screen and (line := run.line()):
            self._console.print(Text(line), soft_wrap=True)

    def _table(self) -> Table:
        made = table("", *_COLUMNS)
        for run in self._runs.values():
            made.add_row(*(Text(cell) for cell in run.cells))
        return made


class _Run:
    """The row of one run."""

    def __init__(self, name: str, scenario: Scenario) -> None:
        self._scenario, self._began_at = scenario, time.monotonic()
        self._line_at = self._began_at
        self._first: tuple[int, float] | None = None  # step and time of the first report
        self._plant = factory("plant", scenario.plant.kind)
        reference = build_reference(scenario)
        # A stick is not known here.
        self._reference = None if isinstance(reference, LiveReference) else reference
        whole = f"0.0 of {scenario.duration_s:g} s"
        self.cells = [printable(name), "getting ready", whole, "-", "-", "-", "-"]

    def receive(self, report: Mapping[str, Any]) -> None:
        """Phase and values of a report."""
        if "outcome" in report:
            self.cells[1] = str(report["outcome"]).replace("_", " ")
        if "step" not in report:
            return
        step, now = int(report["step"]), time.monotonic()
        first, began_at = self._first = self._first or (step, now)
        dt_s = self._scenario.dt_s
        rate = f"{dt_s * (step - first) / (now - began_at):.1f} x real time" if now > began_at else "-"
        controls = ", ".join(f"{name} {value:.3g}" for name, value in report["controls"].items())
        simulated = f"{dt_s * step:.1f} of {self._scenario.duration_s:g} s"
        late = "-" if report["late"] is None else f"{report['late']}"
        error = self._error(step, report["outputs"])
        self.cells[1:] = ["flying", simulated, rate, error, printable(controls), late]

    def line(self) -> str:
        """The row in words, once in some seconds; empty in between."""
        if time.monotonic() - self._line_at < LINE_PERIOD_S:
            return ""
        self._line_at = time.monotonic()
        name, phase, *cells = self.cells
        return f"{name}: {phase}, " + ", ".join(map(" ".join, zip(_COLUMNS[2:], cells, strict=True)))

    def _error(self, step: int, outputs: Mapping[str, float]) -> str:
        if self._reference is None:
            return "-"
        wanted = dict(zip(self._reference.outputs, self._reference.preview(step, 1)[0], strict=True))
        found = []
        for name in filter(outputs.__contains__, wanted):
            scale = shown(self._plant, name)
            found.append(f"{scale.factor * (outputs[name] - wanted[name]):.3g} {scale.unit}")
        return ", ".join(found) or "-"
